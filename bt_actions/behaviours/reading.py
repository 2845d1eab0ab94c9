"""How a leaf reads a result: whether it is as expected, and what of it is saved. No ROS.

Conditions and places may be given as functions of the result, or as text: there ``$x`` is a
variable on the blackboard, and ``result`` what the server gave.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import Any

from py_trees.blackboard import Blackboard, KeyMetaData

from bt_actions.behaviours.variables import key, read
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.suggest import did_you_mean

Names = Callable[[Any], Mapping[str, object]]
"""From a result to what an expression over it may name; called with None, what it could name."""
Given = Callable[[Any], Any] | str


class Reading:
    """The `expect`, `save` and `retry.when` of an action."""

    __slots__ = ("_expect", "_names", "_save", "_wanted", "_written", "when")

    def __init__(
        self,
        expect: Given | None,
        save: Mapping[str, Given],
        when: Given | None,
        names: Names,
    ) -> None:
        """Compile; raises ValueError for what is neither a function nor an expression."""
        self._names = names
        self._written: list[tuple[str, Expression]] = []  # what was given as text
        self._expect = None if expect is None else self._function(expect, "expect")
        self._wanted = expect if isinstance(expect, str) else getattr(expect, "text", None)
        self.when = None if when is None else self._function(when, "retry.when")
        self._save = {key(name): self._function(place, "save") for name, place in save.items()}

    def _function(self, given: Given, what: str) -> Callable[[Any], Any]:
        """Return what was given as a function of the result.

        Raises ValueError for what is none, naming `what` it was given for. A function made from
        text raises ExpressionError where it cannot be computed.
        """
        if callable(given):
            return given
        if not isinstance(given, str):
            raise ValueError(f"{what} must be a callable on the result or an expression as text")
        try:
            expression = Expression(given, roots=self._names(None))
        except ExpressionError as error:
            raise ValueError(f"{what}: {error}") from error
        self._written.append((what, expression))
        compute = expression.evaluate if what == "save" else expression.holds
        return lambda result: compute(self._names(result), read)

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

    def read(self, result: Any) -> str:
        """Check the result, and save what is to be kept of it; or return what is wrong with it."""
        try:
            if self._expect is not None and not self._expect(result):
                wanted = self._wanted or "something else"
                return f"{wanted} was expected, but the result is: {shorten(result)}"
        except ExpressionError as error:
            return str(error)
        try:
            saved = [(name, value(result)) for name, value in self._save.items()]
        except ValueError as error:  # ExpressionError, or what is saved does not fit
            return str(error)
        Blackboard.storage.update(saved)
        return ""
