"""A node of the XML for the functions of kinds: each attribute is accounted for."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Protocol

from bt_actions.importing.names import Scope, milliseconds, node_name
from bt_actions.importing.project import SUBTREES, Project, kind_of, variable_in
from bt_actions.importing.reading import Element
from bt_actions.importing.report import Report, Verdict
from bt_actions.importing.scripts import Refused
from bt_actions.importing.text import Node


class Writing(Protocol):
    """The writer of the tree that the node is in."""

    project: Project
    report: Report
    above: list[str]
    words: dict[str, dict[str, Any]]
    imports: set[str]

    def node(self, element: Element, scope: Scope) -> Node:
        """Write a node."""

    def variable(self, word: str) -> str:
        """Return the name of a new variable."""


class Given:
    """The attributes of a node: those that were taken are accounted for."""

    def __init__(self, writer: Writing, element: Element, scope: Scope) -> None:
        self.writer, self.element, self.scope = writer, element, scope
        self.kind = kind_of(element)
        self._left = {
            name for name in element.attributes if name not in ("ID", "name", "_uid", "_fullpath")
        }

    def text(self, name: str, default: str | None = None) -> str:
        """Take an attribute. Raises Refused where it is missing and has no default."""
        self._left.discard(name)
        found = self.element.attributes.get(name, default)
        if found is None:
            raise Refused("port", f"the port {name!r} is missing")
        if name in self.element.attributes:
            self.converted(name)
        return found

    def converted(self, name: str, why: str = "") -> None:
        """Tell that an attribute was taken over, or how it differs."""
        self._left.discard(name)
        verdict = Verdict.DIFFERS if why else Verdict.CONVERTED
        self.writer.report.attribute(self.element, name, verdict, why)

    def dropped(self, name: str, why: str) -> None:
        """Tell that an attribute has no meaning here."""
        if name in self.element.attributes:
            self._left.discard(name)
            self.writer.report.attribute(self.element, name, Verdict.DROPPED, why)

    def differs(self, why: str) -> None:
        """Tell how the node differs."""
        self.writer.report.node(self.element, Verdict.DIFFERS, why)

    def reference(self, name: str, default: str | None = None) -> str | None:
        """Take an attribute that names a variable, as `$name`; None for any other text."""
        variable = variable_in(self.text(name, default), name)
        if variable is None:
            return None
        if variable in self.scope.literals:
            return str(self.scope.literals[variable])
        return f"${self.scope[variable]}"

    def whole(self, name: str, default: str | None = None) -> int | str:
        """Take a whole number, or `$name`."""
        if (found := self.reference(name, default)) is not None:
            return int(found) if re.fullmatch(r"-?\d+", found) else found
        text = self.text(name, default)
        try:
            return int(text)
        except ValueError:
            raise Refused("port", f"{name}={text!r} is no whole number") from None

    def duration(self, name: str) -> str:
        """Take a number of milliseconds, as a duration."""
        found = self.whole(name)
        return f"= {found} / 1000" if isinstance(found, str) else milliseconds(found)

    def name(self, default: str = "") -> str:
        """Return the node's name."""
        return node_name(self.element.attributes.get("name", "") or default or self.kind)

    @property
    def around(self) -> str:
        """The kind of the parent, or ""."""
        return next((kind for kind in self.writer.above[-2::-1] if kind not in SUBTREES), "")

    def named(self, node: Node) -> Node:
        """Give a node that needs no name the name in the XML."""
        if "name" in self.element.attributes:
            node["name"] = self.name()
        return node

    def only_child(self) -> Node:
        """Write the one child. Raises Refused."""
        if len(self.element.children) != 1:
            raise Refused("children", f"it has {len(self.element.children)} children, not one")
        return self.children()[0]

    def children(self) -> list[Node]:
        """Write all children. Raises Refused where there are none."""
        if not self.element.children:
            raise Refused("children", "it has no children")
        return [self.writer.node(child, self.scope) for child in self.element.children]

    def rest(self) -> None:
        """Drop the attributes that nobody took."""
        for name in sorted(self._left):
            self.dropped(name, f"{self.kind} has nothing of that name here")


Handler = Callable[[Given], Node]
"""Writes a node of one kind. Raises ScriptError."""
