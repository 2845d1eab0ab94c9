"""A leaf that asks whether something holds. It writes nothing and never raises."""

from __future__ import annotations

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.variables import read
from bt_actions.expressions.expression import Expression, ExpressionError


class Check(Behaviour):
    """Succeeds when an expression is true; fails when it is not, or cannot be computed.

    Args:
        name: as in py_trees.
        expression: what must hold, over variables alone (``$count < 3``).
        variable: looks a variable up, raising KeyError for one without a value; the blackboard's
            own keys where not given.

    Raises ExpressionError for a text that is no expression.
    """

    def __init__(
        self,
        name: str,
        expression: Expression | str,
        *,
        variable: Callable[[str], object] | None = None,
    ) -> None:
        super().__init__(name)
        if isinstance(expression, str):
            expression = Expression(expression, roots=())
        self.expression = expression
        self._variable = variable or read

    def update(self) -> Status:
        try:
            holds = self.expression.holds({}, self._variable)
        except ExpressionError as error:
            self.feedback_message = error.message
            return Status.FAILURE
        self.feedback_message = "" if holds else f"{self.expression.text.strip()} is false"
        return Status.SUCCESS if holds else Status.FAILURE
