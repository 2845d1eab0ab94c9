"""Settings, ROS names and writes as they come out for a node, for building and looking ahead."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from bt_actions.document.language.kinds import KINDS
from bt_actions.document.language.values import Computed
from bt_actions.document.reading.tree import Document, TreeNode
from bt_actions.document.yaml.nodes import Mapping as YamlMapping
from bt_actions.document.yaml.nodes import Node

__all__ = [
    "Write",
    "join_names",
    "merged",
    "resources_below",
    "server_of",
    "settings_of",
    "shared_settings",
    "text_of",
    "when_of",
    "writes_of",
]

_WRITERS = {"set", "for_each", *(name for name, kind in KINDS.items() if "save" in kind.keys)}


def text_of(values: Mapping[str, object], key: str) -> str:
    """A text as it is, and anything else as an empty one."""
    value = values.get(key)
    return value if isinstance(value, str) else ""


@lru_cache(maxsize=1024)
def join_names(*parts: str) -> str:
    """ROS names put together; an absolute one, and one of the node's own (~), begins anew."""
    joined = ""
    for part in parts:
        trimmed = part if part == "/" else part.rstrip("/")
        if trimmed.startswith(("/", "~")) or not joined:
            joined = trimmed
        elif trimmed:
            joined = f"{joined.rstrip('/')}/{trimmed}"
    return joined


def merged(base: dict[str, object], over: dict[str, object]) -> dict[str, object]:
    """Two mappings of settings as one, key by key to any depth; `over` wins."""
    result = {**base, **over}
    for name in base.keys() & over:
        earlier, value = base[name], over[name]
        if isinstance(earlier, dict) and isinstance(value, dict):
            result[name] = merged(earlier, value)
    return result


def settings_of(node: TreeNode, document: Document) -> dict[str, object]:
    """A node's settings over its alias's over the document's defaults, key by key."""
    return merged(shared_settings(node.alias, document), node.values)


def shared_settings(alias: str | None, document: Document) -> dict[str, object]:
    """What the nodes of an alias (None: of no alias) have where they say nothing."""
    shared = document.settings.get(alias)
    if shared is None:
        declared = document.actions.get(alias) if alias is not None else None
        own = declared.values if declared is not None else {}
        shared = document.settings[alias] = merged(document.defaults, own)
    return shared


def server_of(settings: Mapping[str, object]) -> str:
    """The name of an action's server; that of a server of trees where none is given."""
    return text_of(settings, "server") or "run_tree"


def when_of(settings: object) -> object:
    """The condition of settings for another attempt."""
    retry = settings.get("retry") if isinstance(settings, dict) else None
    return retry.get("when") if isinstance(retry, dict) else None


_Known = dict[tuple[int, str], dict[str, TreeNode]]


def resources_below(
    root: TreeNode, document: Document, namespace: str = "", known: _Known | None = None
) -> dict[str, TreeNode]:
    """What the actions of a subtree hold while they run, with the first node that does.

    `known` keeps what trees that are included hold, for later calls.
    """
    known = {} if known is None else known
    found: dict[str, TreeNode] = {}
    inner = join_names(namespace, document.namespace)
    for node in root.walk():
        if node.included is not None and node.included.root is not None:
            below = join_names(inner, text_of(node.values, "namespace"))
            there = (id(node.included.root), below)
            if there not in known:
                known[there] = resources_below(node.included.root, node.included, below, known)
            for name in known[there]:
                found.setdefault(name, node)
        elif node.is_action:
            settings = settings_of(node, document)
            if settings.get("busy") == "share":
                continue
            given = settings.get("resources")
            names = given if isinstance(given, list) and given else [server_of(settings)]
            for name in names:
                full = join_names(inner, text_of(settings, "namespace"), str(name))
                found.setdefault(full, node)
    return found


@dataclass(slots=True, eq=False)
class Write:
    """A variable that a node writes: from `value`, an expression over `root` or plain data."""

    name: str
    node: TreeNode
    under: str
    """The key of the node that says so; none where the action's declaration does."""
    value: object
    root: str | None = None

    @property
    def written(self) -> Node:
        """What says so; the node itself, where its action's declaration does."""
        node, table = self.node, self.node.written.get(self.under)
        if isinstance(table, YamlMapping):
            return table.get(self.name) or node.node
        return node.node if not self.under else table or node.key

    @property
    def depends(self) -> bool:
        """Does the type of what is written depend on those of variables?"""
        return isinstance(self.value, Computed) and bool(self.value.expression.variables)


def writes_of(node: TreeNode, document: Document) -> list[Write]:
    """The variables that a node itself writes."""
    values = node.values
    kind, interface = node.kind.name, node.kind.interface
    if kind not in _WRITERS:
        return []
    saved = values.get("save")
    own = saved if isinstance(saved, dict) else {}
    declared = document.actions.get(node.alias) if node.alias is not None else None
    shared = declared.values.get("save") if declared is not None else None
    root = interface.root if interface is not None else None
    writes = [Write(name, node, "save", value, root) for name, value in own.items()]
    if isinstance(shared, dict):
        given = [pair for pair in shared.items() if pair[0] not in own]
        writes = [Write(name, node, "", value, "result") for name, value in given] + writes
    if kind == "set" and isinstance(table := values.get("set"), dict):
        writes += [Write(name, node, "set", value) for name, value in table.items()]
    elif kind == "for_each":
        item, index = values.get("as", "item"), values.get("index")
        if isinstance(item, str):
            writes.append(Write(item, node, "as", values.get("in"), "item of"))
        if isinstance(index, str):
            writes.append(Write(index, node, "index", 0))
    return writes
