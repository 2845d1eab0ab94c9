"""Which variables a node writes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from bt_actions.document.language.values import Computed
from bt_actions.document.reading.tree import Document, TreeNode
from bt_actions.document.yaml.nodes import Mapping, Node

__all__ = ["Write", "writes_of"]


@dataclass(frozen=True, slots=True)
class Write:
    """A variable that a node writes: from `value`, an expression over `root` or plain data."""

    name: str
    node: TreeNode
    written: Node
    value: object
    root: str | None = None

    @property
    def depends(self) -> bool:
        """Does the type of what is written depend on those of variables?"""
        return isinstance(self.value, Computed) and bool(self.value.expression.names)


def writes_of(node: TreeNode, document: Document) -> Iterator[Write]:
    """The variables that a node itself writes."""
    values = node.values
    declared = document.actions.get(node.alias) if node.alias is not None else None
    if declared is not None:
        own = values.get("save")
        shared = declared.values.get("save")
        for name, value in (shared if isinstance(shared, dict) else {}).items():
            if not isinstance(own, dict) or name not in own:
                yield Write(name, node, node.node, value, "result")
    saved = values.get("save")
    if isinstance(saved, dict):
        table = _values_in(node.written.get("save"))
        for name, value in saved.items():
            inner = table.get(name)
            root = None if node.kind is not None and node.kind.name == "subtree" else "result"
            if node.kind is not None and node.kind.name == "wait_for_message":
                root = "message"
            yield Write(name, node, inner or node.node, value, root)
    if node.kind is None:
        return
    if node.kind.name == "set" and isinstance(values.get("set"), dict):
        table = _values_in(node.written.get("set"))
        for name, value in values["set"].items():  # type: ignore[attr-defined]
            inner = table.get(name)
            yield Write(name, node, inner or node.node, value)
    if node.kind.name == "for_each":
        item = values.get("as", "item")
        if isinstance(item, str):
            yield Write(item, node, node.written.get("as", node.key), values.get("in"), "item of")
        index = values.get("index")
        if isinstance(index, str):
            yield Write(index, node, node.written["index"], 0)


def _values_in(table: Node | None) -> dict[str, Node]:
    """The YAML nodes of a mapping's values, by their keys."""
    if not isinstance(table, Mapping):
        return {}
    return {key.text: value for key, value in table.pairs}
