"""Which variables a node writes."""

from __future__ import annotations

from dataclasses import dataclass

from bt_actions.document.language.kinds import KINDS
from bt_actions.document.language.values import Computed
from bt_actions.document.reading.tree import Document, TreeNode
from bt_actions.document.yaml.nodes import Mapping, Node

__all__ = ["Write", "writes_of"]


_WRITERS = {"set", "for_each", *(name for name, kind in KINDS.items() if "save" in kind.keys)}


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
        if isinstance(table, Mapping):
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
