"""The reading of a result by a leaf: the check against `expect`, and the values to save. No ROS.

A result is the answer of an action or a service, or a message of a topic. Conditions and places are
functions of a result; in their text, ``$x`` is a variable, and ``result`` the server's answer.
"""

from __future__ import annotations

import ast
import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.blackboard import Blackboard, KeyMetaData

from bt_actions.behaviours.variables import key, read, write
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.suggest import did_you_mean

Names = Callable[[Any], Mapping[str, object]]
"""From a result to the names for expressions over it; from None, to all possible names."""
Given = Callable[[Any], Any] | str


def of_result(result: Any) -> Mapping[str, object]:
    """Return the names for most expressions."""
    return {"result": result}


def of_feedback(feedback: Any) -> Mapping[str, object]:
    """Return the names for expressions over feedback."""
    return {"feedback": feedback}


def of_failure(given: Any) -> Mapping[str, object]:
    """Return the names for expressions over a failure.

    A result (None without one) and an outcome.
    """
    if given is None:
        return {"result": None, "outcome": None}
    result, outcome = given
    return {"outcome": outcome} if result is None else {"result": result, "outcome": outcome}


@dataclass(slots=True, eq=False)
class Formula:
    """An expression over a result, as a function of that result."""

    expression: Expression
    names: Names
    variable: Callable[[str], object] = read
    fit: Callable[[Any], object] | None = None
    """The function that makes the kept value of the computed one; None for a condition."""
    get: Callable[[Any], object] | None = None
    """A faster function for a value that is kept as it is."""

    @property
    def text(self) -> str:
        """The expression as it was written."""
        return self.expression.text

    def seen(self, given: Any) -> dict[str, object]:
        """Return the values of the names in the expression."""
        return self.expression.seen(self.names(given), self.variable)

    def __call__(self, given: Any) -> Any:
        """Return the value; raises ExpressionError, and ValueError for one that does not fit."""
        if self.get is not None:
            return self.get(given)
        if self.fit is None:
            return self.expression.holds(self.names(given), self.variable)
        return self.fit(self.expression.evaluate(self.names(given), self.variable))


class Reading:
    """The `expect` and `save` of a leaf, and the `retry.when` of an action."""

    __slots__ = ("_expect", "_names", "_save", "_unmet", "_what", "_written", "wanted", "when")

    def __init__(
        self,
        expect: Given | None,
        save: Mapping[str, Given],
        when: Given | None = None,
        names: Names = of_result,
        what: str = "result",
    ) -> None:
        """Make a reading; `what` names the read thing in messages.

        Raises ValueError for a condition or place that is neither a function nor an expression.
        """
        self._names, self._what = names, what
        self._written: list[tuple[str, Expression]] = []  # those given as text
        self._unmet = False
        self._expect = None if expect is None else self._function(expect, "expect")
        self.wanted = str(getattr(self._expect, "text", ""))
        self.when = None if when is None else self._function(when, "retry.when")
        self._save = {key(name): self._function(place, "save") for name, place in save.items()}

    def _function(self, given: Given, use: str) -> Callable[[Any], Any]:
        """Return a function of the result for a function or a text.

        Raises ValueError for anything else, with the `use` it was given for.
        """
        if callable(given):
            return given
        if not isinstance(given, str):
            raise ValueError(f"{use} must be a callable on the result or an expression as text")
        try:
            expression = Expression(given, roots=self._names(None))
        except ExpressionError as error:
            raise ValueError(f"{use}: {error}") from error
        self._written.append((use, expression))
        return Formula(expression, self._names, fit=(lambda it: it) if use == "save" else None)

    def set_up(self, result_type: Any) -> str:
        """Tell the blackboard of the keys, so that it shows them.

        Returns an objection to a field that a result of this type lacks; or "".
        """
        for name in self._save:
            Blackboard.metadata.setdefault(name, KeyMetaData())
        for what, expression in self._written:
            for node in ast.walk(expression.tree):
                match node:
                    case ast.Attribute(
                        value=ast.Name(id=("result" | "feedback") as root), attr=name
                    ):
                        if not hasattr(result_type, name):  # nor a constant
                            hint = did_you_mean(name, result_type.get_fields_and_field_types())
                            return f"{what}: {root} has no field {name!r}{hint}"
        return ""

    def save(self, result: Any) -> None:
        """Save the values that the result has; the other places keep theirs."""
        saved = {}
        for name, value in self._save.items():
            with contextlib.suppress(ValueError):
                saved[name] = value(result)
        write(saved)

    def is_enough(self, feedback: Any) -> bool:
        """Return whether a condition holds, if there is one; then save what the feedback has."""
        try:
            return self._expect is not None and bool(self._expect(feedback))
        except ExpressionError:
            return False
        finally:
            self.save(feedback)

    def seen(self, result: Any) -> dict[str, object]:
        """Return the values of the names in `expect`, where the last result did not meet it.

        Else {}.
        """
        seen = getattr(self._expect, "seen", None)
        return seen(result) if self._unmet and callable(seen) else {}

    def read(self, result: Any) -> str:
        """Check the result, and save its values; return the objection to it, or ""."""
        self._unmet = self._expect is not None
        try:
            if self._expect is not None and not self._expect(result):
                wanted = self.wanted or "something else"
                return f"{wanted} was expected, but the {self._what} is: {shorten(result)}"
        except ExpressionError as error:
            return str(error)
        self._unmet = False
        try:
            saved = {name: value(result) for name, value in self._save.items()}
        except ValueError as error:  # ExpressionError, or a value that does not fit
            return str(error)
        write(saved)
        return ""
