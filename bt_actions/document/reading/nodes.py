"""From YAML nodes to the nodes of a tree: their kinds, and the forms of their keys.

Mistakes are reported as in `read.py`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping as MappingType
from itertools import chain

from bt_actions.document.findings import Place, Related
from bt_actions.document.findings.elsewhere import key_here, kind_here
from bt_actions.document.language.keys import ACTION_KEYS
from bt_actions.document.language.kinds import KINDS, NODE_KEYS, Group, Interface, own_kind
from bt_actions.document.language.scalars import Name, is_computed, words_for, wrong_form
from bt_actions.document.language.shapes import Key, Table, report_unknown_key
from bt_actions.document.language.types import interface_of
from bt_actions.document.language.values import BAD
from bt_actions.document.reading.tree import Document, TreeNode, text_of
from bt_actions.document.reading.unread import Doubts
from bt_actions.document.yaml.nodes import (
    Listing,
    Mapping,
    Node,
    Scalar,
    data_of,
    span_of,
    start_of,
)
from bt_actions.messages.as_fields import as_fields
from bt_actions.utilities.suggest import closest, did_you_mean, folded, listing

_CHILDREN = ("child", "children")
_BESIDE_CHILD = frozenset({"timeout", "retry"})
"""Words that are kinds only beside `child:`, and settings of an action elsewhere."""
_BESIDE_TYPE = frozenset({"action", *_BESIDE_CHILD})
"""Words that are keys in a node whose kind stands behind 'type:'."""
_LONGEST = 40
_SIGNS = frozenset(":,{}[]#\n")
_IN_SEQUENCE = "put a sequence there, and the list into it: {sequence: name, children: [...]}"


def read_root(document: Document) -> None:
    """Read the nodes of a document, once all its actions are known (its imports' among them)."""
    written = document.node.get("root")
    if written is not None:
        document.root = _Reader(document).tree(written)


class _Reader:
    """Reads nodes without recursion: children wait in a list while others are read."""

    def __init__(self, document: Document) -> None:
        self._source = document.source
        self._actions = document.actions
        self._own = {
            name: own_kind(name, text_of(each.values, "children") or "none")
            for name, each in document.kinds.items()
        }
        self._kinds = dict.fromkeys((*KINDS, *document.actions, *self._own))
        self._doubts = Doubts(document)
        actions = document.node.get("actions")
        own = actions.pairs if isinstance(actions, Mapping) else []
        self._refused = {key.text for key, _ in own} & NODE_KEYS
        """Reported names of actions that look like keys: such a key may mean the action."""
        self._astray = {key.text for key, _ in document.node.pairs} & {*_CHILDREN}
        """Keys of some node that stand at the top, and are reported there."""
        self._waiting: list[tuple[TreeNode, Node]] = []
        """Children to be read, each with its parent; the last is read next."""

    def tree(self, written: Node) -> TreeNode | None:
        """Read the tree that begins with a node."""
        root = self._node(written)
        while self._waiting:
            parent, item = self._waiting.pop()
            child = self._node(item)
            if child is not None:
                child.level = parent.level + 1
                parent.children.append(child)
        return root

    def _node(self, written: Node) -> TreeNode | None:
        """Read a node by itself; its children wait."""
        source = self._source
        if not isinstance(written, Mapping):
            hint: str | None = None
            if isinstance(written, Scalar):
                word, _, name = written.text.partition(":")
                if word in self._kinds:
                    kind = KINDS.get(word)
                    example = f"{word}: {name.strip() or 'name'}"
                    if kind is not None and not (name or kind.named_by_value):
                        example = kind.example.partition("\n")[0]
                    hint = f"write '{example}'"
            elif isinstance(written, Listing) and written.items:
                hint = _IN_SEQUENCE
            message = f"a node is a mapping such as 'sequence: name', not {words_for(written)}"
            source.report("BT111", span_of(written), message, hint=hint)
            source.unread.nodes.append(written)
            return None
        key = self._kind_key(written)
        if key is None:
            self._only_children(written)
            source.unread.nodes.append(written)
            return None
        kind = KINDS.get(key.text) or self._own.get(key.text)
        if kind is not None:
            node = TreeNode(kind, key, written, source)
            self._fill(node, kind.keys)
        else:
            node = TreeNode(KINDS["action"], key, written, source, alias=key.text)
            self._fill(node, ACTION_KEYS)
        return node

    def _typed(self, written: Mapping, said: Node) -> bool:
        """Report a node whose kind stands behind 'type:', and return whether there is one."""
        if not isinstance(said, Scalar) or "/" in said.text:
            return False
        kinds = {folded(kind): kind for kind in self._kinds}
        word, here = kinds.get(folded(said.text)), kind_here(said.text)
        keys = {key.text for key, _ in written.pairs if key.text in kinds.values()}
        if not (word or (here and "action" not in keys)) or keys - _BESIDE_TYPE:
            return False
        name, action = written.get("name"), written.get("action")
        if word == "action" and isinstance(action, Scalar):
            if action.text in self._actions or name is not None:
                word = action.text
            else:
                name = action
        if word:
            here = f"write '{word}: {name.text if isinstance(name, Scalar) else '...'}'"
        key = next(key for key, inner in written.pairs if inner is said)
        self._source.report("BT111", span_of(key), "a node's kind is its key", hint=here)
        self._source.unread.actions = True
        return True

    def _kind_key(self, written: Mapping) -> Scalar | None:
        """Return the one key that is a kind or an alias, or None after a report."""
        kinds, said = [], None
        for key, inner in written.pairs:
            if key.text in self._kinds:
                kinds.append(key)
            elif key.text == "type":
                said = inner
        if said is not None and self._typed(written, said):
            return None
        if len(kinds) == 1 and kinds[0].text not in _BESIDE_CHILD:
            return kinds[0]
        alone = _BESIDE_CHILD if written.get("child") is None else ()
        held = {
            name
            for key in kinds
            if key.text in KINDS and key.text not in alone
            for name in KINDS[key.text].holds
            if name != key.text
        }
        kinds = [key for key in kinds if key.text not in held]  # though an action is called so
        found = [key for key in kinds if key.text not in _BESIDE_CHILD]
        beside = [key for key in kinds if key.text in _BESIDE_CHILD]
        if not found and written.get("child") is not None:
            found = beside[:1]
        if len(found) == 1:
            return found[0]
        if found:
            first, second = found[0], found[1]
            place = Place(self._source.name, first.line, first.column)
            self._source.report(
                "BT112", span_of(second),
                f"a node has one kind: this is {_a_kind(first.text)} and {_a_kind(second.text)}",
                hint=self._nested(written, first, second) or "begin a new item with '-'",
                related=Related(place, "the first is here"),
            )  # fmt: skip
            return None
        words = [key for key, _ in written.pairs if key.text not in NODE_KEYS]
        if len(beside) == 1 and not words:
            has_children = written.get("children") is not None
            if has_children or self._holds_nodes(written.get(beside[0].text)):
                return beside[0]  # with what it holds in the place of 'child'
        self._report_no_kind(written, words)
        return None

    def _nested(self, written: Mapping, first: Scalar, second: Scalar) -> str | None:
        """Say what to write where one of two kinds is a decorator, to stand around the other."""
        for outer, inner in ((first, second), (second, first)):
            kind = KINDS.get(outer.text)
            if kind is not None and kind.group is Group.DECORATOR:
                return _around(written, outer, inner)
        return None

    def _report_no_kind(self, written: Mapping, words: list[Scalar]) -> None:
        if not words and any(key.text in self._refused for key, _ in written.pairs):
            self._source.unread.actions = True
            return
        words = words or [key for key, _ in written.pairs if kind_here(key.text)]
        if not words:
            hint = "one key of a node is its kind, such as 'sequence: name'"
            self._source.report("BT111", start_of(written), "this node has no kind", hint=hint)
            return
        self._source.unread.actions = True
        if any(self._doubts.declares(word.text) for word in words):
            return
        known = [*self._kinds]
        meant = (word for word in words if kind_here(word.text) or closest(word.text, known))
        key = next(meant, words[0])
        same = folded(key.text) in map(folded, known)
        here = None if same else kind_here(key.text)
        near = f"; {here}" if here else did_you_mean(key.text, known)
        own = listing(self._actions)
        hint = f"this tree's actions are {own}" if own else "this tree declares no actions"
        message = f"no kind of node and no action is called {key.text!r}{near}"
        self._source.report("BT201", span_of(key), message, hint=None if near else hint)

    def _only_children(self, written: Mapping) -> None:
        """Read the nodes below a node that could not be read, for their own mistakes."""
        for name in _CHILDREN:
            inner = written.get(name)
            if inner is not None:
                self._children(
                    TreeNode(KINDS["action"], Scalar(), written, self._source), name, inner
                )

    def _fill(self, node: TreeNode, keys: MappingType[str, Key]) -> None:
        source, values, written = self._source, node.values, node.written
        kind, interface = node.kind, node.kind.interface
        unknown = False
        beside: list[tuple[Scalar, Node]] = []
        held: dict[str, Node] = {}
        for key, inner in chain(node.node.pairs, beside):
            name = key.text
            if name in kind.holds and (key is not node.key or isinstance(inner, Mapping)):
                written[name] = held[name] = inner
            elif key is node.key:
                written[name] = inner
                if isinstance(inner, Scalar):
                    value = kind.value.read(inner, source)
                elif hint := self._below_name(node, inner, keys, beside):
                    value = wrong_form(kind.value, inner, source, hint=hint)
                else:
                    value = kind.value.read(inner, source)
                values[name] = value
                if isinstance(value, str) and kind.named_by_value:
                    node.name = value
                if value is BAD:
                    source.unread.nodes.append(inner)
            else:
                known = keys.get(name)
                if known is None:
                    unknown = True
                    self._report_unknown(node, key, keys)
                    source.unread.nodes += (key, inner)
                    if name in _CHILDREN:
                        astray = TreeNode(KINDS["action"], key, node.node, source)
                        self._children(astray, name, inner)
                    continue
                written[name] = inner
                if isinstance(inner, Listing) and interface and name == interface.fields:
                    typed = self._actions[node.alias].node if node.alias else node.node
                    hint = _fields_for(interface, inner, typed)
                    value = wrong_form(known.shape, inner, source, hint=hint)
                else:
                    value = known.shape.read(inner, source)
                values[name] = value
                if value is BAD:
                    source.unread.nodes.append(inner)
                    source.unread.names |= isinstance(known.shape, Name)
        for name in reversed(kind.holds):  # the next to be read is the last
            if name in held:
                self._children(node, name, held[name])
        if isinstance(own := values.get("name"), str):
            node.name = own
        if unknown:
            return
        needs = kind.needs if node.alias is None else ()
        missing = [key for key in needs if key.name not in written and key.name not in self._astray]
        if missing and node.is_action and node.name in self._actions:
            said = f"{node.name!r} is an action of this tree: its name is the node's kind"
            source.report("BT108", span_of(node.key), said, hint=f"write '{node.name}: name'")
            source.unread.nodes.append(node.key)
            source.unread.actions = True
            return
        for wanted in missing:
            source.report(
                "BT108", span_of(node.key),
                f"{node.key.text!r} needs the key {wanted.name!r}", hint=wanted.hint,
            )  # fmt: skip
            source.unread.nodes.append(node.key)

    def _below_name(
        self,
        node: TreeNode,
        inner: Node,
        keys: MappingType[str, Key],
        beside: list[tuple[Scalar, Node]],
    ) -> str | None:
        """Say what to write for a collection below a kind's word, in the place of a name.

        The reading goes on as if the collection stood where it belongs: keys that belong beside the
        word are added to `beside`. None where no meaning is likely.
        """
        kind = node.kind
        if isinstance(kind.value, Table):
            return None
        write = f"write '{node.key.text}: {'name' if kind.named_by_value else '...'}'"
        held = next((name for name in _CHILDREN if name in keys), None)
        fields = kind.interface.fields if kind.interface is not None else ""
        if isinstance(inner, Mapping):
            names = {key.text for key, _ in inner.pairs}
            known = names & {*keys, "name"}
            if known and (not fields or known == names or known & {fields, "type"}):
                beside += [pair for pair in inner.pairs if pair[0].text != "name"]
                name = inner.get("name")
                if isinstance(name, Scalar) and kind.named_by_value:
                    write = f"write '{node.key.text}: {name.text}'"
                return f"{write}, and the keys beside it"
            if fields:
                return f"{write}, and the fields beside it, under '{fields}:'"
        if held is None or not kind.named_by_value or node.node.get(held) is not None:
            return None
        if not self._holds_nodes(inner):
            return None
        node.written[held] = inner
        items = inner.items if isinstance(inner, Listing) else [inner]
        self._waiting += [(node, item) for item in reversed(items)]
        what = "list" if held == "children" else "node"
        if what == "node" and len(items) > 1:
            what = "'sequence' of these nodes"
        return f"{write}, and the {what} beside it, under '{held}:'"

    def _holds_nodes(self, inner: Node | None) -> bool:
        """Return whether `inner` is a list, or a node, rather than a setting."""
        return isinstance(inner, Listing) or (
            isinstance(inner, Mapping)
            and any(key.text in self._kinds or key.text in _CHILDREN for key, _ in inner.pairs)
        )

    def _report_unknown(self, node: TreeNode, key: Scalar, keys: MappingType[str, Key]) -> None:
        if key.text in _CHILDREN:
            other = "child" if key.text == "children" else "children"
            hint = f"it holds {other!r}" if other in keys else "it is a leaf"
            message = f"{node.key.text!r} has no {key.text!r}"
            self._source.report("BT107", span_of(key), message, hint=hint)
        else:
            hint = None
            near = None if key_here(key.text, keys)[0] else _decorator_of(key.text, keys)
            if near and near not in keys:
                hint = _around(node.node, key, node.key, near)
            if key.text == "name" and "name" not in keys:
                hint = f"the name stands behind '{node.key.text}:'"
            report_unknown_key(key, keys, self._source, hint)

    def _children(self, node: TreeNode, name: str, inner: Node) -> None:
        if name != "children":
            if isinstance(inner, Listing):
                message = f"{name!r} is one node, not a list"
                self._source.report("BT109", span_of(inner), message, hint=_IN_SEQUENCE)
                self._source.unread.nodes.append(inner)
                written: list[Node] = inner.items
            else:
                written = [inner]
        elif not isinstance(inner, Listing):
            message = f"a list of nodes is needed, not {words_for(inner)}"
            hint = "each child begins with '- '" if isinstance(inner, Mapping) else None
            self._source.report("BT109", span_of(inner), message, hint=hint)
            self._source.unread.nodes.append(inner)
            return
        else:
            written = inner.items
            if not written:
                self._source.report("BT110", span_of(inner), "there must be a child at least")
                self._source.unread.nodes.append(inner)
        self._waiting += [(node, item) for item in reversed(written)]


def _decorator_of(word: str, keys: MappingType[str, Key]) -> str | None:
    """Return the decorator that an unknown key is likely to mean."""
    names = [kind.name for kind in KINDS.values() if kind.group is Group.DECORATOR]
    meant = {key: name for name in names for key in KINDS[name].keys if key != "name"}
    meant |= {name: name for name in names}
    if word in meant or closest(word, keys) or any(key_here(word, keys)):
        return meant.get(word)
    return closest(word, (*_BESIDE_CHILD, "repeat"))


def _around(written: Mapping, outer: Scalar, inner: Scalar, decorator: str = "") -> str:
    """Put a decorator around a node: `outer` and `inner` are the two keys of the text.

    `decorator` is the likely kind, where `outer` is one of its keys, or looks like its name.
    """
    decorator = decorator or outer.text
    kind = KINDS[decorator]
    keys, setting = kind.keys, kind.reads
    said = _text(written.get(decorator))
    if said == "..." and outer.text not in keys:
        said = _text(written.get(outer.text))
    name = _text(written.get(inner.text))
    parts = [f"{decorator}: {name if kind.named_by_value else said}"]
    if setting in keys:  # how often, or how long
        given = _text(written.get(setting))
        if given == "..." and said[:1].isdigit():
            given = said
        parts.append(f"{setting}: {keys[setting].example if given == '...' else given}")
    own = {key: _text(written.get(key)) for key in keys if key != setting}
    parts += [f"{key}: {given}" for key, given in own.items() if key != "name" and given != "..."]
    parts.append(f"child: {{{inner.text}: {name}, ...}}")
    return f"{_a_kind(decorator)} goes around the node: {{{', '.join(parts)}}}"


def _a_kind(word: str) -> str:
    """Return ``a 'retry'``, ``an 'invert'``."""
    return f"{'an' if word[0] in 'aeiou' else 'a'} {word!r}"


def _text(node: Node | None) -> str:
    """Return a short scalar as it is, where that can stand in braces; dots for anything else."""
    said = node.text if isinstance(node, Scalar) else ""
    return said if 0 < len(said) <= _LONGEST and _SIGNS.isdisjoint(said) else "..."


def _fields_for(interface: Interface, inner: Listing, typed: Node) -> str | None:
    """Return a hint for a list in the place of fields; `typed` holds the interface's type."""
    named = typed.get("type") if isinstance(typed, Mapping) else None
    if not isinstance(named, Scalar):
        return None
    with contextlib.suppress(ValueError):  # TypeNameError is one
        cls = interface_of(named.text, interface.kind)
        data = [None if is_computed(each) else data_of(each) for each in inner.items]
        instead = as_fields(interface.part(cls, interface.sent), data)
        return f"write {instead}" if instead else None
    return None
