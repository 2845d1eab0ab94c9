"""From YAML nodes to a document, by the language: the keys at the top.

Every mistake of form is reported, and the reading goes on; names and types are the checker's. A
reported part becomes BAD, so that no second finding is about it.
"""

from __future__ import annotations

from collections.abc import Mapping as MappingType

from bt_actions.document.findings import Related, Span
from bt_actions.document.findings.elsewhere import key_here
from bt_actions.document.language.keys import DEFAULTS, LIBRARY_KEYS, TOP_KEYS
from bt_actions.document.language.kinds import KINDS, NODE_KEYS, SINCE
from bt_actions.document.language.scalars import words_for
from bt_actions.document.language.shapes import Key, read_keys
from bt_actions.document.language.values import BAD
from bt_actions.document.reading.tree import Declared, Document
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.nodes import Mapping, span_of, start_of
from bt_actions.document.yaml.source import Source
from bt_actions.utilities.suggest import closest


def read_document(source: Source, *, library: bool = False) -> Document | None:
    """Read the document in a source, without its nodes (`nodes.py` reads these); None without one.

    `library` is a file that another imports: it needs no tree, and may hold none.
    """
    errors = len(source.findings)
    node = compose(source)
    if node is None:
        if len(source.findings) == errors:
            source.report("BT106", Span(1, 1, 1, 2), "the file is empty")
        return None
    if not isinstance(node, Mapping):
        message = f"a tree is a mapping with the keys 'tree' and 'root', not {words_for(node)}"
        hint = "write 'tree: name' and 'root:', and below that a node"
        source.report("BT106", span_of(node), message, hint=hint)
        return None
    document = Document(source, node)
    has_root = node.get("root") is not None
    if not library and not has_root and node.get("tree") is None:
        library = any(
            node.get(name) is not None for name in ("actions", "topics", "kinds", "defaults")
        )
        if not library:
            message = "this is not a tree: the keys 'tree' and 'root' are missing"
            source.report("BT106", start_of(node), message)
            return None
    keys = TOP_KEYS if has_root or not library else LIBRARY_KEYS
    misplaced = _misplaced(node, keys, source) if "root" in keys else []
    values = read_keys(node, keys, source, {"root", *misplaced})
    if (
        not library
        and not has_root
        and all(closest(key.text, keys) != "root" for key, _ in node.pairs)
    ):
        message = "the key 'root' is missing: it holds the tree's nodes"
        source.report("BT108", start_of(node), message)
    document.values = values
    name = values.get("tree")
    document.name = name if isinstance(name, str) else ""
    for table in ("inputs", "outputs", "actions", "topics", "kinds"):
        _declare(document, table, getattr(document, table))
    defaults = values.get("defaults")
    document.defaults = dict(defaults) if isinstance(defaults, dict) else {}
    return document


def _misplaced(node: Mapping, keys: MappingType[str, Key], source: Source) -> list[str]:
    """Report keys at the top that belong to a node, or to all actions; return their names."""
    found = []
    for key, _ in node.pairs:
        if key.text in keys or not _of_node(key.text) or any(key_here(key.text, keys)):
            continue
        hint = "indent it below 'root:', as far as the other keys of its node"
        if key.text in DEFAULTS.keys:
            hint = f"for all actions write defaults: {{{key.text}: ...}}"
        source.report("BT107", span_of(key), f"{key.text!r} is a key of a node", hint=hint)
        source.unread.names = True
        found.append(key.text)
    return found


def _of_node(name: str) -> bool:
    return name in KINDS or name in NODE_KEYS


def _declare(document: Document, table: str, into: dict[str, Declared]) -> None:
    written = document.node.get(table)
    values = document.values.get(table)
    if not isinstance(written, Mapping) or not isinstance(values, dict):
        return
    for key, node in written.pairs:
        if key.text not in values:
            continue
        read = values[key.text]
        own = read if isinstance(read, dict) else {}
        if read is BAD:
            own = {"type": BAD}
        into[key.text] = Declared(key.text, own, key, node, document.source)
        if table == "kinds" and key.text in document.actions:
            first = document.actions[key.text]
            document.source.report(
                "BT216", span_of(key), f"{key.text!r} is declared twice",
                related=Related(first.place, "an action is called so here"),
            )  # fmt: skip
            del into[key.text]
        elif table in ("actions", "kinds") and _of_node(key.text):
            what = "a kind of node" if key.text in KINDS else "a key of nodes"
            hint = None
            if since := SINCE.get(key.text):
                what = f"{what} since bt_actions {since}"
                hint = f"rename it here and where it is used, such as '{key.text}_action'"
            named = "an action" if table == "actions" else "a kind of one's own"
            text = f"{key.text!r} is {what} and cannot name {named}"
            document.source.report("BT208", span_of(key), text, hint=hint)
            del into[key.text]
