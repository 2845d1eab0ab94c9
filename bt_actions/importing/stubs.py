"""Kinds to be written, in place of nodes without a map: their ports, and their classes.

The XML's TreeNodesModel says whether a port is read or written; without one it is read. The type is
that of the model, of a variable that is given to the port, or of a value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from bt_actions.document.language.kinds import KINDS, NODE_KEYS
from bt_actions.importing.given import Given
from bt_actions.importing.names import NOTHING, identifier, value_of
from bt_actions.importing.project import SUBTREES, Project, kind_of, ports_of, variable_in
from bt_actions.importing.reading import Element
from bt_actions.importing.text import Node

MODULE = "leaves_to_write"
_HEAD = '''"""Kinds of the imported trees that are to be written: nothing was known of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status


class ToWrite(Behaviour):
    """Fails, and ticks nothing that it holds."""

    inputs: Any
    outputs: Any

    def __init__(
        self, name: str, child: Behaviour | None = None, children: Iterable[Behaviour] = ()
    ) -> None:
        super().__init__(name)
        self.children = [child] if child is not None else list(children)
        for each in self.children:
            each.parent = self

    def update(self) -> Status:
        self.feedback_message = f"{type(self).__name__} is to be written"
        return Status.FAILURE
'''


@dataclass(slots=True)
class Stub:
    """A kind to be written."""

    name: str
    inputs: dict[str, object] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    children: str = "none"

    @property
    def declaration(self) -> dict[str, object]:
        """The declaration in a tree that uses the kind."""
        made: dict[str, object] = {"python": f"{MODULE}.{self.name}"}
        if self.inputs:
            made["inputs"] = self.inputs
        if self.outputs:
            made["outputs"] = self.outputs
        return made if self.children == "none" else {**made, "children": self.children}


def stub_of(project: Project, kind: str) -> Stub:
    """Return the stub of a kind, as all trees use it."""
    uses = [
        element
        for definition in project.trees.values()
        for element in definition.element.walk()
        if kind == (_tree_of(element) or kind_of(element))
    ]
    name = identifier(kind)
    stub = Stub(f"{name}_" if name in KINDS or name in NODE_KEYS else name)
    held = {len(element.children) for element in uses}
    if held - {0}:
        stub.children = "one" if held == {1} else "many"
    for port in sorted({port for element in uses for port, _ in ports_of(element)}):
        texts = [element.attributes[port] for element in uses if port in element.attributes]
        direction, type_name = project.direction(kind, port), _type(project, kind, port, texts)
        word = identifier(port)
        if direction != "output":
            everywhere = len(texts) == len(uses)
            nothing = {"type": type_name, "default": NOTHING.get(type_name, {})}
            stub.inputs[word] = type_name if everywhere else nothing
        if direction != "input":
            stub.outputs[word] = type_name
    return stub


def _tree_of(element: Element) -> str:
    return element.attributes.get("ID", "") if element.tag in SUBTREES else ""


def _type(project: Project, kind: str, port: str, texts: Iterable[str]) -> str:
    """Return the common type of all values of a port; string for two types."""
    variables = {text: variable_in(text, port) for text in texts}
    found = {
        _of_literal(text) if name is None else project.type_of(name)
        for text, name in variables.items()
    }
    known = project.model_types.get(kind, {}).get(port)
    if known and found <= {known, "int64"}:
        return known
    if len(found) == 1:
        return found.pop()
    return "float64" if found == {"float64", "int64"} else "string"


def _of_literal(text: str) -> str:
    value = value_of(text, "")
    if isinstance(value, float) and not math.isfinite(value):
        return "string"
    return {bool: "bool", int: "int64", float: "float64"}.get(type(value), "string")


def _as(kind: str, reference: str | None, given: str) -> str | None:
    """Return a variable of another type as a text, or a text as the number that it holds."""
    function = {"string": "str", "float64": "float", "int64": "int"}.get(kind)
    is_text = "string" in (kind, given)
    if reference is None or function is None or kind == given or not is_text or "/" in given:
        return reference
    return f"= {function}({reference})"


def stub_node(given: Given, why: str) -> Node:
    """Write a node of a kind to be written."""
    project, scope = given.writer.project, given.scope
    kind = _tree_of(given.element) or given.kind
    stub = project.stubs.get(kind)
    if not isinstance(stub, Stub):
        stub = project.stubs[kind] = stub_of(project, kind)
    given.writer.words["kinds"][stub.name] = stub.declaration
    given.differs(f"{why}: write {MODULE}.{stub.name}")
    node = Node({stub.name: given.name(kind)})
    values: dict[str, object] = {}
    saved: dict[str, str] = {}
    for port, text in ports_of(given.element):
        word, name = identifier(port), variable_in(text, port)
        given.converted(port)
        if word in stub.inputs:
            form = stub.inputs[word]
            known = str(form["type"] if isinstance(form, dict) else form)
            values[word] = (
                value_of(text, known)
                if name is None
                else _as(known, given.reference(port), project.type_of(name))
            )
        if word in stub.outputs and name is not None:
            saved[scope[name]] = word
    if values:
        node["with"] = values
    if saved:
        node["save"] = saved
    if stub.children == "one":
        node["child"] = given.only_child()
    elif stub.children == "many":
        node["children"] = given.children()
    return node


def module(stubs: Iterable[Stub]) -> str:
    """Return the classes to be written, as a module."""
    return _HEAD + "".join(map(_class, sorted(stubs, key=lambda stub: stub.name)))


def _class(stub: Stub) -> str:
    told = [f"reads {', '.join(stub.inputs)}"] if stub.inputs else []
    told += [f"gives {', '.join(stub.outputs)}"] if stub.outputs else []
    text = re.sub(r"\W+$", "", "; ".join(told)) or "takes nothing"
    return f'\n\nclass {stub.name}(ToWrite):\n    """To be written: {text}."""\n'
