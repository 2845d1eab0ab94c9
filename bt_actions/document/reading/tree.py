"""A document after reading: what was said, with the YAML node each part came from.

Plain values, and what comes of them for a node: settings, ROS names, writes. Nothing here checks or
builds.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from bt_actions.document.findings import Place
from bt_actions.document.language.kinds import Kind
from bt_actions.document.language.values import Computed
from bt_actions.document.yaml.nodes import Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source


@dataclass(slots=True, eq=False, repr=False)
class TreeNode:
    """A node of the tree.

    `values` holds what was read under each key (the kind's own key included), `written` the YAML
    node of each; `level` is how deep it is, from 1. `alias` is the action's name in this document,
    where the node's key is one; its kind is `action` then. `included` is the tree that a subtree
    stands for. `is_action` tells whether it sends a goal, also to a server of trees.
    """

    kind: Kind
    key: Scalar
    node: Mapping
    source: Source
    alias: str | None = None
    name: str = ""
    level: int = 1
    values: dict[str, object] = field(default_factory=dict)
    written: dict[str, Node] = field(default_factory=dict)
    children: list[TreeNode] = field(default_factory=list)
    included: Document | None = None
    is_action: bool = field(init=False)

    def __post_init__(self) -> None:
        self.is_action = self.kind.is_action

    @property
    def place(self) -> Place:
        """Where the node's kind is written, or the node begins whose kind is merged into it."""
        node, at = self.node, self.key.begin
        if not node.begin.index <= at.index < node.end.index:
            at = node.begin
        return Place(self.source.name, at.line + 1, at.column + 1)

    def release(self) -> None:
        """Keep of the YAML only where it stands: nothing more is made from it."""
        self.node.pairs.clear()
        self.written.clear()

    def walk(self) -> Iterator[TreeNode]:
        """This node and all below it, in the order of the text."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))


@dataclass(slots=True)
class Declared:
    """Something with a name: an input, an output, an action, a topic."""

    name: str
    values: dict[str, object]
    key: Scalar
    node: Node
    source: Source

    @property
    def place(self) -> Place:
        return Place(self.source.name, self.key.line, self.key.column)

    @property
    def parts(self) -> dict[str, Node]:
        """The YAML node of each of its keys."""
        pairs = self.node.pairs if isinstance(self.node, Mapping) else ()
        return {key.text: inner for key, inner in pairs}

    def written(self, key: str) -> Node:
        """The YAML node of one of its keys, or of the whole where it is written short."""
        return self.parts.get(key, self.node)


@dataclass(slots=True)
class Document:
    """A tree, or a library of actions and topics for trees to import."""

    source: Source
    node: Mapping
    values: dict[str, object] = field(default_factory=dict)
    name: str = ""
    inputs: dict[str, Declared] = field(default_factory=dict)
    outputs: dict[str, Declared] = field(default_factory=dict)
    actions: dict[str, Declared] = field(default_factory=dict)
    topics: dict[str, Declared] = field(default_factory=dict)
    kinds: dict[str, Declared] = field(default_factory=dict)
    """The kinds of its own."""
    defaults: dict[str, object] = field(default_factory=dict)
    settings: dict[str | None, dict[str, object]] = field(default_factory=dict)
    """What each alias (None: no alias) has where a node says nothing; made when first asked for."""
    root: TreeNode | None = None
    imported: list[Document] = field(default_factory=list)
    size: int = 0
    height: int = 0
    """How many nodes the tree has, and on how many levels, with all that it includes."""
    gated: bool = False
    """Whether a node of the tree, or of one that it includes, may be left out."""
    _nodes: tuple[TreeNode, ...] = ()

    @property
    def namespace(self) -> str:
        value = self.values.get("namespace", "")
        return value if isinstance(value, str) else ""

    def with_imports(self) -> Iterator[Document]:
        """This document and all that it imports, each once."""
        waiting, seen = [self], set()
        while waiting:
            one = waiting.pop()
            if id(one) not in seen:
                seen.add(id(one))
                yield one
                waiting.extend(one.imported)

    def nodes(self) -> tuple[TreeNode, ...]:
        """All nodes of the tree, which was read to its end, in the order of the text."""
        if not self._nodes and self.root is not None:
            self._nodes = tuple(self.root.walk())
        return self._nodes


def text_of(values: MappingType[str, object], key: str) -> str:
    """A text as it is, and anything else as an empty one."""
    value = values.get(key)
    return value if isinstance(value, str) else ""


def table_of(value: object) -> dict[str, Any]:
    """A mapping as it is, and anything else as an empty one."""
    return value if isinstance(value, dict) else {}


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
    for name, earlier in base.items():
        if isinstance(earlier, dict) and isinstance(value := over.get(name), dict):
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


def server_of(settings: MappingType[str, object]) -> str:
    """The name of an action's server; that of a server of trees where none is given."""
    return text_of(settings, "server") or "run_tree"


def when_of(settings: object) -> object:
    """The condition of settings for another attempt."""
    retry = settings.get("retry") if isinstance(settings, dict) else None
    return retry.get("when") if isinstance(retry, dict) else None


SAVES = ("save", "save_on_failure")
"""The keys whose names an action's nodes write."""
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
    def depends(self) -> bool:
        """Does the type of what is written depend on those of variables?"""
        return isinstance(self.value, Computed) and bool(self.value.expression.variables)


def writes_of(node: TreeNode, document: Document) -> list[Write]:
    """The variables that a node itself writes."""
    values = node.values
    kind, interface = node.kind, node.kind.interface
    if kind.writes is not None:
        return [Write(one, node, key, value, root) for one, key, value, root in kind.writes(values)]
    if "save" not in kind.keys:
        return []
    declared = document.actions.get(node.alias) if node.alias is not None else None
    root = interface.root if interface is not None else None
    writes = []
    for key in SAVES:
        if key not in values and (declared is None or key not in declared.values):
            continue
        own, shared = table_of(values.get(key)), table_of(declared and declared.values.get(key))
        given = [pair for pair in shared.items() if pair[0] not in own]
        writes += [Write(name, node, "", value, "result") for name, value in given]
        writes += [Write(name, node, key, value, root) for name, value in own.items()]
    return writes


def always_there(document: Document) -> set[str]:
    """The variables that have a value from the beginning, though no one gives it: zero."""
    tables = (
        settings_of(node, document).get(SAVES[1]) for node in document.nodes() if node.is_action
    )
    return {name for table in tables for name in table_of(table)}
