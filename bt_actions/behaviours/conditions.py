"""Conditions and places that a user may give as a function or as text. No ROS.

In text, ``$x`` is a variable on the blackboard, and ``result`` what the server gave.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

from bt_actions.behaviours.variables import read
from bt_actions.expressions.expression import Expression, ExpressionError
from bt_actions.utilities.suggest import did_you_mean


def condition_of(
    given: Callable[[Any], bool] | str | None, what: str
) -> Callable[[Any], bool] | None:
    """Return the condition as a function of the result; raises ValueError for what is none.

    One made from text raises ExpressionError where it cannot be computed.
    """
    if given is None or callable(given):
        return given
    expression = _expression(given, what)
    return lambda result: expression.holds({"result": result}, read)


def function_of(given: Callable[[Any], Any] | str, what: str) -> Callable[[Any], Any]:
    """As `condition_of`, for any value."""
    if callable(given):
        return given
    expression = _expression(given, what)
    return lambda result: expression.evaluate({"result": result}, read)


def unknown_field(expression: Expression, root: str, message_type: Any) -> str:
    """Say which field an expression reads of a message that has none of this name; or ""."""
    fields = message_type.get_fields_and_field_types()
    for node in ast.walk(expression.tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            known = node.attr in fields or hasattr(message_type, node.attr)  # as constants are
            if node.value.id == root and not known:
                return f"{root} has no field {node.attr!r}{did_you_mean(node.attr, fields)}"
    return ""


def _expression(text: object, what: str) -> Expression:
    """The text as an expression; raises ValueError, naming `what` it was given for."""
    if not isinstance(text, str):
        raise ValueError(f"{what} must be a callable on the result or an expression as text")
    try:
        return Expression(text)
    except ExpressionError as error:
        raise ValueError(f"{what}: {error}") from error
