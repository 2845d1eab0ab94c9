"""Conditions and assignments in the XML, with the variables that they have here."""

from __future__ import annotations

import re
from collections.abc import Callable

from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.importing.names import Scope
from bt_actions.importing.project import Project
from bt_actions.importing.scripts import (
    Part,
    Refused,
    Sort,
    assigned,
    condition,
    constant,
    say,
    statements,
    truth,
)
from bt_actions.importing.text import Node


def asked(project: Project, code: str, scope: Scope, *, negated: bool = False) -> str:
    """Return a condition. Raises ScriptError."""
    part = condition(code)
    if negated:
        part = _negated(part)
    said = say(part, _sort_of(project), _reference(project, scope))
    return _checked(truth(said).text)


def assignments(project: Project, code: str, scope: Scope, name: str = "") -> list[Node]:
    """Return a script, as a node for each of its statements. Raises ScriptError."""
    nodes = []
    for statement in statements(code):
        if not statement.name:
            continue  # a value that nothing is done with
        said = assigned(statement, _sort_of(project), _reference(project, scope))
        value = constant(said)
        if value is None:
            text = _checked(said.text)
            value = text if _is_reference(text) else f"= {text}"
        node = Node(set={scope[statement.name]: value})
        if name:
            node["name"] = name
        nodes.append(node)
    return nodes


def _sort_of(project: Project) -> Callable[[str], Sort]:
    constants = project.mapping.constants
    return lambda name: Sort.NUMBER if name in constants else project.sorts[name]


def _reference(project: Project, scope: Scope) -> Callable[[str], str]:
    def reference(name: str) -> str:
        """Return the words behind the dollar sign; a value, whose \\0 takes that sign away."""
        if name in project.mapping.constants:
            return f"\0{project.mapping.constants[name]}"
        if name in scope.literals:
            return f"\0{_literal(scope.literals[name])}"
        return scope[name]

    return reference


def _literal(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def _checked(text: str) -> str:
    """Return an expression that our language takes. Raises Refused."""
    text = text.replace("$\0", "")
    try:
        Expression(text, roots=())
    except ExpressionError as error:
        raise Refused("script", error.message) from None
    return text


def _is_reference(text: str) -> bool:
    return re.fullmatch(r"\$[A-Za-z][\w.]*", text, re.ASCII) is not None


_OPPOSITE = {"==": "!=", "!=": "==", "<": ">=", "<=": ">", ">": "<=", ">=": "<"}


def _negated(part: Part) -> Part:
    if part.kind == "unary" and part.signs == ("!",):
        return part.parts[0]
    if part.kind == "compare" and len(part.signs) == 1:
        return Part("compare", (_OPPOSITE[part.signs[0]],), part.parts)
    return Part("unary", ("!",), (part,))
