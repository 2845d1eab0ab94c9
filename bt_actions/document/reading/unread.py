"""What the errors of a document leave open: parts that could not be read, and names in them.

One mistake is told once. A name that may be declared in such a part is not called unknown, one that
may be used there is not called unused, and no hazard is told of a node that holds such a part.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass, field

from bt_actions.document.reading.tree import Document, TreeNode
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source

_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)
_NAME = re.compile(r"[A-Za-z0-9_ -]+")
"""What somebody may have written as a name, and no expression."""
_KNOWN = ("root", "inputs", "outputs", "actions", "topics")
"""Keys at the top of a tree whose values say nothing about the settings of all actions."""


@dataclass(slots=True)
class _Words:
    """The words of unread parts: those that may be declared there, and all."""

    declared: set[str] = field(default_factory=set)
    mentioned: set[str] = field(default_factory=set)


class Doubts:
    """What is not certain about one document; made anew after more of it was read."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._sources = [one.source for one in document.with_imports()]
        self._parts = [source.unread for source in self._sources]
        self._words: _Words | None = None
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

    @property
    def declared(self) -> set[str]:
        """The words of what could not be read that may be names."""
        return self._all_words().declared

    def mentions(self, name: str) -> bool:
        """Whether a name may stand in what could not be read, or be what an unknown one means."""
        return (
            any(part.names or name in part.meant for part in self._parts)
            or name in self._all_words().mentioned
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

    def _all_words(self) -> _Words:
        if self._words is None:
            self._words = _Words()
            for part in self._parts:
                _collect(part.nodes, self._words)
        return self._words


def _collect(nodes: list[Node], words: _Words) -> None:
    waiting, seen = list(nodes), set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, Mapping):
            for key, value in node.pairs:
                waiting += (key, value)
        elif isinstance(node, Listing):
            waiting.extend(node.items)
        elif isinstance(node, Scalar):
            found = _WORD.findall(node.text)
            words.mentioned.update(found)
            if _NAME.fullmatch(node.text):
                words.declared.update((node.text, *found))
