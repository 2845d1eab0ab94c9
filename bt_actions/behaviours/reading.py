"""How a leaf reads a result: whether it is as expected, and what of it is saved. No ROS.

A result is what an action or a service gave, or a message of a topic. Conditions and places are
functions of it; as text, ``$x`` in them is a variable, and ``result`` what the server gave.
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
"""From a result to what an expression over it may name; called with None, what it could name."""
Given = Callable[[Any], Any] | str


def of_result(result: Any) -> Mapping[str, object]:
    """What most expressions may name."""
    return {"result": result}


def of_feedback(feedback: Any) -> Mapping[str, object]:
    """What expressions over feedback may name."""
    return {"feedback": feedback}


def of_failure(given: Any) -> Mapping[str, object]:
    """What expressions over a failure may name, of a result (None where there was none) and why."""
    if given is None:
        return {"result": None, "outcome": None}
    result, outcome = given
    return {"outcome": outcome} if result is None else {"result": result, "outcome": outcome}


@dataclass(slots=True, eq=False)
class Formula:
    """An expression over a result, as a function of that."""

    expression: Expression
    names: Names
    variable: Callable[[str], object] = read
    fit: Callable[[Any], object] | None = None
    """What makes of the value what is kept of it; None for a condition."""
    get: Callable[[Any], object] | None = None
    """What gets a value that is kept as it is, in less time."""

    @property
    def text(self) -> str:
        """The expression as it was written."""
        return self.expression.text

    def seen(self, given: Any) -> dict[str, object]:
        """What stood for the names in it."""
        return self.expression.seen(self.names(given), self.variable)

    def __call__(self, given: Any) -> Any:
        """The value; raises ExpressionError, and ValueError for one that does not fit."""
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
        """`what` says in messages what is read.

        Raises ValueError for what is neither a function nor an expression.
        """
        self._names, self._what = names, what
        self._written: list[tuple[str, Expression]] = []  # what was given as text
        self._unmet = False
        self._expect = None if expect is None else self._function(expect, "expect")
        self.wanted = str(getattr(self._expect, "text", ""))
        self.when = None if when is None else self._function(when, "retry.when")
        self._save = {key(name): self._function(place, "save") for name, place in save.items()}

    def _function(self, given: Given, use: str) -> Callable[[Any], Any]:
        """Return what was given as a function of the result.

        Raises ValueError for what is none, naming the `use` it was given for.
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

        Return which field one of them reads that a result of this type has not; or "".
        """
        for name in self._save:
            Blackboard.metadata.setdefault(name, KeyMetaData())
        for what, expression in self._written:
            for node in ast.walk(expression.tree):
                match node:
                    case ast.Attribute(value=ast.Name(id="result"), attr=name):
                        if not hasattr(result_type, name):  # nor a constant
                            hint = did_you_mean(name, result_type.get_fields_and_field_types())
                            return f"{what}: result has no field {name!r}{hint}"
        return ""

    def save(self, result: Any) -> None:
        """Save what of it can be: a place that is not in it keeps what it had."""
        saved = {}
        for name, value in self._save.items():
            with contextlib.suppress(ValueError):
                saved[name] = value(result)
        write(saved)

    def seen(self, result: Any) -> dict[str, object]:
        """What stood for the names in `expect`, where the result that was read last is not as
        expected; else nothing."""
        seen = getattr(self._expect, "seen", None)
        return seen(result) if self._unmet and callable(seen) else {}

    def read(self, result: Any) -> str:
        """Check the result, and save what is to be kept of it; or return what is wrong with it."""
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
        except ValueError as error:  # ExpressionError, or what is saved does not fit
            return str(error)
        write(saved)
        return ""
