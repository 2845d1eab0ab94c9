"""What the errors of a document leave open: parts that could not be read, and names in them.

One mistake is told once. A name that may be declared in such a part is not called unknown, one that
may be used there is not called unused, and no hazard is told of a node that holds such a part.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from functools import cached_property

from bt_actions.document.reading.tree import Document, TreeNode
from bt_actions.document.yaml.nodes import Node
from bt_actions.document.yaml.source import Source
from bt_actions.document.yaml.written import scalars_of

_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)
_NAME = re.compile(r"[A-Za-z0-9_ -]+")
"""What somebody may have written as a name, and no expression."""
_KNOWN = ("root", "inputs", "outputs", "actions", "topics", "kinds")
"""Keys at the top of a tree whose values say nothing about the settings of all actions."""


class Doubts:
    """What is not certain about one document; made anew after more of it was read."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._sources = [one.source for one in document.with_imports()]
        self._parts = [source.unread for source in self._sources]
        self._places: dict[int, list[tuple[int, int]]] = {}

    @property
    def any(self) -> bool:
        """Whether there is anything that is not certain."""
        return any(
            part.nodes or part.names or part.variables or part.actions for part in self._parts
        ) or any(
            node.included is not None and node.included.source.has_errors
            for node in self._document.nodes()
        )

    def declares(self, name: str) -> bool:
        """Whether a name may be declared in what could not be read."""
        return any(part.names for part in self._parts) or name in self.declared

    @cached_property
    def declared(self) -> set[str]:
        """The words of what could not be read that may be names."""
        names = (text for text in self._texts if _NAME.fullmatch(text))
        return {word for text in names for word in (text, *_WORD.findall(text))}

    def mentions(self, name: str) -> bool:
        """Whether a name may stand in what could not be read, or be what an unknown one means."""
        return (
            any(part.names or name in part.meant for part in self._parts) or name in self._mentioned
        )

    @property
    def unknown_variable(self) -> bool:
        """Whether a variable is read that nobody knows: any may be meant."""
        return any(part.variables for part in self._parts)

    @property
    def unknown_action(self) -> bool:
        """Whether there is a node of a kind that nobody knows: any action may be meant."""
        return any(part.actions for part in self._parts)

    def own(self, node: TreeNode) -> bool:
        """Whether something of a node itself, not of its children, could not be read."""
        if not node.source.unread.nodes:
            return False
        inner = sum(self._count(child.node, node.source) for child in node.children)
        return node.source.anchored or self._count(node.node, node.source) > inner

    def below(self, root: TreeNode) -> bool:
        """Whether something of a node or what is below it, or of what they use, is open."""
        parts = [part for part in self._parts if part.nodes or part.names]
        if parts and (self._settings() or self._within(root.node, root.source)):
            return True
        for node in root.walk():
            if node.included is not None and node.included.source.has_errors:
                return True
            if parts and node.alias is not None and self.alias(node.alias):
                return True
        return False

    def alias(self, name: str) -> bool:
        """Whether something of an action's declaration, or of all actions' settings, is open."""
        declared = self._document.actions.get(name)
        return self._settings() or (
            declared is not None and self._within(declared.node, declared.source)
        )

    def _settings(self) -> bool:
        """Whether settings that hold for all actions may be in what could not be read."""
        if any(part.names for part in self._parts):
            return True
        for document in self._document.with_imports():
            if document.source.unread.nodes:
                known = [document.node.get(name) for name in _KNOWN]
                inside = sum(self._count(one, document.source) for one in known if one is not None)
                if inside < len(document.source.unread.nodes):
                    return True
        return False

    def _within(self, node: Node, source: Source) -> bool:
        return bool(source.unread.nodes) and (source.anchored or self._count(node, source) > 0)

    def _count(self, node: Node, source: Source) -> int:
        """How many unread parts begin inside a node."""
        places = self._places.get(id(source))
        if places is None:
            places = sorted((one.line, one.column) for one in source.unread.nodes)
            self._places[id(source)] = places
        end = (node.end_line, max(node.end_column, node.column + 1))
        return bisect_left(places, end) - bisect_left(places, (node.line, node.column))

    @cached_property
    def _mentioned(self) -> set[str]:
        return {word for text in self._texts for word in _WORD.findall(text)}

    @cached_property
    def _texts(self) -> set[str]:
        """All that stands in what could not be read."""
        unread = [node for part in self._parts for node in part.nodes]
        return {scalar.text for node in unread for scalar in scalars_of(node)}
