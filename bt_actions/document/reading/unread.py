"""Doubts: questions that the errors of a document leave open. One mistake makes one finding.

The reader stops at an error, so the checker does not know the rest of that part of the text. The
checker would then report correct parts: a variable would be unknown because its declaration is
unread, or an action unused because its only user is unread. Each source keeps its unread
parts (`Source.unread`): their YAML nodes, and flags for names that may be anything. From these
`Doubts` answers, before such a report:

- The checker reports no unknown name that an unread part may declare (`declares`).
- The checker reports no unused name that an unread part may use (`mentions`). Any word in an
  unread text counts as a use.
- The checker reports no hazard of a node that holds an unread part (`own`, `below`), whose settings
  are unread (`alias`), or that includes a tree with errors. The places of a part and a node in the
  text tell whether the part lies inside of the node. With an anchor in the text the answer is yes.
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
"""A text that may be a name, and no expression."""
_KNOWN = ("root", "inputs", "outputs", "actions", "topics", "kinds")
"""Keys at the top of a tree whose values hold no settings of all actions."""


class Doubts:
    """The doubts about one document; made anew after more of the document was read."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._sources = [one.source for one in document.with_imports()]
        self._parts = [source.unread for source in self._sources]
        self._places: dict[int, list[tuple[int, int]]] = {}

    @property
    def any(self) -> bool:
        """Whether the document has any doubt."""
        return any(
            part.nodes or part.names or part.variables or part.actions for part in self._parts
        ) or any(
            node.included is not None and node.included.source.has_errors
            for node in self._document.nodes()
        )

    def declares(self, name: str) -> bool:
        """Return whether an unread part may declare a name."""
        return any(part.names for part in self._parts) or name in self.declared

    @cached_property
    def declared(self) -> set[str]:
        """The words of unread parts that may be names."""
        names = (text for text in self._texts if _NAME.fullmatch(text))
        return {word for text in names for word in (text, *_WORD.findall(text))}

    def mentions(self, name: str) -> bool:
        """Return whether an unread part may use a name, or an unknown name may mean it."""
        return (
            any(part.names or name in part.meant for part in self._parts) or name in self._mentioned
        )

    @property
    def unknown_variable(self) -> bool:
        """Whether an unknown variable is read, which may mean any variable."""
        return any(part.variables for part in self._parts)

    @property
    def unknown_action(self) -> bool:
        """Whether a node has an unknown kind, which may mean any action."""
        return any(part.actions for part in self._parts)

    def own(self, node: TreeNode) -> bool:
        """Return whether a node itself, without its children, has an unread part."""
        if not node.source.unread.nodes:
            return False
        inner = sum(self._count(child.node, node.source) for child in node.children)
        return node.source.anchored or self._count(node.node, node.source) > inner

    def below(self, root: TreeNode) -> bool:
        """Return whether a node, a node below, or an action that these use has an unread part."""
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
        """Return whether an action's declaration, or settings of all actions, may be unread."""
        declared = self._document.actions.get(name)
        return self._settings() or (
            declared is not None and self._within(declared.node, declared.source)
        )

    def _settings(self) -> bool:
        """Return whether an unread part may hold settings of all actions."""
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
        """Count the unread parts that begin inside a node."""
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
        """All scalars in unread parts."""
        unread = [node for part in self._parts for node in part.nodes]
        return {scalar.text for node in unread for scalar in scalars_of(node)}
