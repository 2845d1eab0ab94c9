"""Conditions and places that a user may give as a function or as text. No ROS.

In text, ``$x`` is a variable on the blackboard, and ``result`` what the server gave.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bt_actions.behaviours.variables import read
from bt_actions.expression import Expression, ExpressionError


def condition_of(
    given: Callable[[Any], bool] | str | None, what: str
) -> Callable[[Any], bool] | None:
    """Return the condition as a function of the result; raises ValueError for what is none.

    One made from text raises ExpressionError where it cannot be computed.
    """
    if given is None or callable(given):
        return given
    if not isinstance(given, str):
        raise ValueError(f"{what} must be a callable on the result or an expression as text")
    expression = expression_of(given, what)
    return lambda result: expression.holds({"result": result}, read)


def expression_of(text: str | Expression, what: str) -> Expression:
    """Return the text as an expression; raises ValueError, naming `what` it was given for."""
    if isinstance(text, Expression):
        return text
    try:
        return Expression(text)
    except ExpressionError as error:
        raise ValueError(f"{what}: {error}") from error
