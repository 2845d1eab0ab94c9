"""A document after reading: what was said, with the YAML node each part came from.

Plain values; nothing here checks or builds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from bt_actions.document.findings import Place
from bt_actions.document.language.kinds import Kind
from bt_actions.document.yaml.nodes import Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source

__all__ = ["Declared", "Document", "TreeNode"]


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
        self.is_action = self.kind.name in ("action", "run_tree")

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
    defaults: dict[str, object] = field(default_factory=dict)
    settings: dict[str | None, dict[str, object]] = field(default_factory=dict)
    """What each alias (None: no alias) has where a node says nothing; made when first asked for."""
    root: TreeNode | None = None
    imported: list[Document] = field(default_factory=list)
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
