"""A document after reading: plain values, with the YAML node of each part.

What follows from the values for a node is here, too: settings, ROS names, writes. Nothing here
checks or builds.
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

    `values` holds the value of each key (the kind's own key included), `written` the YAML node of
    each. `level` is the depth of the node, from 1. `alias` is the action's name in this document,
    where the node's key is one; the kind is `action` then. `included` is the tree that a subtree
    stands for. `is_action` tells whether the node sends a goal, also to a server of trees.
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
        """The place of the node's kind; of the node itself where the kind is merged into it."""
        node, at = self.node, self.key.begin
        if not node.begin.index <= at.index < node.end.index:
            at = node.begin
        return Place(self.source.name, at.line + 1, at.column + 1)

    def release(self) -> None:
        """Drop the YAML nodes, but for their places: nothing more is made from them."""
        self.node.pairs.clear()
        self.written.clear()

    def walk(self) -> Iterator[TreeNode]:
        """Yield this node and all nodes below it, in the order of the text."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))


@dataclass(slots=True)
class Declared:
    """A declaration with a name: an input, an output, an action, a topic."""

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
        """The YAML node of each key."""
        pairs = self.node.pairs if isinstance(self.node, Mapping) else ()
        return {key.text: inner for key, inner in pairs}

    def written(self, key: str) -> Node:
        """Return the YAML node of a key, or of the whole declaration in its short form."""
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
    """The kinds that the document declares."""
    defaults: dict[str, object] = field(default_factory=dict)
    settings: dict[str | None, dict[str, object]] = field(default_factory=dict)
    """The settings of each alias (None: no alias) for nodes that say nothing; made on demand."""
    root: TreeNode | None = None
    imported: list[Document] = field(default_factory=list)
    size: int = 0
    height: int = 0
    """The number of nodes and of levels of the tree, with all that it includes."""
    gated: bool = False
    """Whether `only_if` or `only_while` may leave out a node of the tree, or of an included one."""
    _nodes: tuple[TreeNode, ...] = ()

    @property
    def namespace(self) -> str:
        value = self.values.get("namespace", "")
        return value if isinstance(value, str) else ""

    def with_imports(self) -> Iterator[Document]:
        """Yield this document and all that it imports, each once."""
        waiting, seen = [self], set()
        while waiting:
            one = waiting.pop()
            if id(one) not in seen:
                seen.add(id(one))
                yield one
                waiting.extend(one.imported)

    def nodes(self) -> tuple[TreeNode, ...]:
        """Return all nodes of the tree in the order of the text, once the whole tree is read."""
        if not self._nodes and self.root is not None:
            self._nodes = tuple(self.root.walk())
        return self._nodes


def text_of(values: MappingType[str, object], key: str) -> str:
    """Return the text under a key; "" for anything else."""
    value = values.get(key)
    return value if isinstance(value, str) else ""


def table_of(value: object) -> dict[str, Any]:
    """Return a mapping as it is, and {} for anything else."""
    return value if isinstance(value, dict) else {}


@lru_cache(maxsize=1024)
def join_names(*parts: str) -> str:
    """Join ROS names; an absolute name, and a name of the node's own (~), begins anew."""
    joined = ""
    for part in parts:
        trimmed = part if part == "/" else part.rstrip("/")
        if trimmed.startswith(("/", "~")) or not joined:
            joined = trimmed
        elif trimmed:
            joined = f"{joined.rstrip('/')}/{trimmed}"
    return joined


def merged(base: dict[str, object], over: dict[str, object]) -> dict[str, object]:
    """Merge two mappings of settings, key by key to any depth; `over` wins."""
    result = {**base, **over}
    for name, earlier in base.items():
        if isinstance(earlier, dict) and isinstance(value := over.get(name), dict):
            result[name] = merged(earlier, value)
    return result


def settings_of(node: TreeNode, document: Document) -> dict[str, object]:
    """Return a node's settings over its alias's over the document's defaults, key by key."""
    return merged(shared_settings(node.alias, document), node.values)


def shared_settings(alias: str | None, document: Document) -> dict[str, object]:
    """Return the settings of an alias (None: of no alias) for nodes that say nothing."""
    shared = document.settings.get(alias)
    if shared is None:
        declared = document.actions.get(alias) if alias is not None else None
        own = declared.values if declared is not None else {}
        shared = document.settings[alias] = merged(document.defaults, own)
    return shared


def server_of(settings: MappingType[str, object]) -> str:
    """Return the name of an action's server; of the server of trees where no name is given."""
    return text_of(settings, "server") or "run_tree"


def when_of(settings: object) -> object:
    """Return the condition of settings for another attempt."""
    retry = settings.get("retry") if isinstance(settings, dict) else None
    return retry.get("when") if isinstance(retry, dict) else None


SAVES = ("save", "save_on_failure", "save_feedback")
"""The keys whose names an action's nodes write."""
_Known = dict[tuple[int, str], dict[str, TreeNode]]


def resources_below(
    root: TreeNode, document: Document, namespace: str = "", known: _Known | None = None
) -> dict[str, TreeNode]:
    """Return the resources that a subtree's actions hold, each with the first node that holds it.

    `known` keeps the resources of included trees, for later calls.
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
    """The node's key that says so; "" where the action's declaration says so."""
    value: object
    root: str | None = None

    @property
    def depends(self) -> bool:
        """Whether the type of the written value depends on the types of variables."""
        return isinstance(self.value, Computed) and bool(self.value.expression.variables)


def writes_of(node: TreeNode, document: Document) -> list[Write]:
    """Return the variables that a node itself writes."""
    values = node.values
    kind, interface = node.kind, node.kind.interface
    if kind.writes is not None:
        return [Write(one, node, key, value, root) for one, key, value, root in kind.writes(values)]
    if "save" not in kind.keys:
        return []
    declared = document.actions.get(node.alias) if node.alias is not None else None
    received = interface.root if interface is not None else None
    writes = []
    for key in SAVES:
        if key not in values and (declared is None or key not in declared.values):
            continue
        root = "feedback" if key == "save_feedback" else received
        own, shared = table_of(values.get(key)), table_of(declared and declared.values.get(key))
        given = [pair for pair in shared.items() if pair[0] not in own]
        writes += [Write(name, node, "", value, root) for name, value in given]
        writes += [Write(name, node, key, value, root) for name, value in own.items()]
    return writes


def always_there(document: Document) -> set[str]:
    """Return the variables with a value from the beginning that nobody gives: zero."""
    tables = (
        settings_of(node, document).get(SAVES[1]) for node in document.nodes() if node.is_action
    )
    return {name for table in tables for name in table_of(table)}
