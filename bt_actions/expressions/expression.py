"""Expressions of a tree: ``result.stalled and $count < 3``, parsed once, evaluated often.

An expression goes through three stages. `text.py` translates the text into one that Python's parser
reads (`$name` becomes `_name`), and keeps the origin of each character. `form.py` parses the
translation, refuses every part of Python that it does not list, and makes each node a closure. This
file lets expressions share forms: ``$left.x > 0`` and ``$right.x > 0`` differ in a name alone, so
both become ``$v.x > 0`` and have one form from a cache. `Expression` keeps the names and gives them
to the form, in reading order.

Sharing has two costs. A form's columns are columns of ``$v.x > 0``: `_column` adds the lengths of
the names before a column. And a quoted text may hold ``$name``, too: where the form reads fewer
variables than the text has names, the expression gets a form of its own.

No ROS here. Evaluation calls nothing but what `functions.py` lists, reads no name that begins with
an underscore, makes no large number and no large text, and raises nothing but `ExpressionError`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache

from bt_actions.expressions.form import Failed, Form
from bt_actions.expressions.text import ExpressionError
from bt_actions.expressions.values import reason, show

MAX_LENGTH = 2000
"""Characters in one expression."""
_NAME = re.compile(r"\$([A-Za-z]\w*)", re.ASCII)
_form = lru_cache(maxsize=1024)(Form)


class Expression:
    """An expression that was read and found well-formed.

    `roots` are the bare names it may use (`result`, `feedback`, `message`, `item`). `variables` are
    the variables it reads, without the dollar sign, in reading order; `tree` is its syntax tree,
    for type-checkers.
    """

    __slots__ = ("form", "text", "variables")

    def __init__(
        self,
        text: str,
        *,
        roots: Iterable[str] = frozenset({"result"}),
        constants: Callable[[str], object] | None = None,
    ) -> None:
        """Read `text`. Raises ExpressionError.

        `constants` returns the value of ``MoveRobot.Result.STATUS_FAULT``, or raises ValueError,
        when the expression is evaluated.
        """
        self.text = text
        if len(text) > MAX_LENGTH:
            raise ExpressionError(f"longer than {MAX_LENGTH} characters", 0, len(text))
        if not text.strip():
            raise ExpressionError("an empty expression", 0, len(text))
        parts = _NAME.split(text)
        self.variables = tuple(parts[1::2])
        given = frozenset(roots)
        try:
            self.form = _form("$v".join(parts[::2]), given, constants)
        except ExpressionError:
            self.form = Form(text, given, constants)  # its error has the author's columns
        if len(self.form.variables) != len(self.variables):  # some stand in a text
            self.form = Form(text, given, constants)
            self.variables = tuple(node.id[1:] for node in self.form.variables.values())

    def __repr__(self) -> str:
        return f"<Expression {self.text!r}>"

    @property
    def tree(self) -> ast.expr:
        return self.form.tree

    @property
    def roots(self) -> frozenset[str]:
        return self.form.roots

    @property
    def asked(self) -> frozenset[str]:
        """The variables that `known` asks for: the expression is right without their values."""
        asked = self.form.asked
        if not asked:
            return frozenset()
        read = zip(self.variables, self.form.variables, strict=True)
        return frozenset(name for name, at in read if at in asked)

    @property
    def variable_spans(self) -> tuple[tuple[str, tuple[int, int]], ...]:
        """Each of `variables` with the columns it spans (the dollar sign included)."""
        spans = map(self.span, self.form.variables.values())
        return tuple(zip(self.variables, spans, strict=True))

    def evaluate(self, roots: Mapping[str, object], variable: Callable[[str], object]) -> object:
        """Return the value; `variable` returns a variable's, or raises KeyError."""
        try:
            return self.form.evaluate(roots, variable, self.variables)
        except ExpressionError:
            raise
        except Failed as failed:
            start, end = self.span(failed.node)
            why = failed.why
            if not isinstance(why, str):
                why = reason(why, self.text[start:end])
            raise ExpressionError(why, start, end) from failed.__cause__
        except Exception as error:
            why = reason(error, self.text.strip())
            raise ExpressionError(f"cannot be computed: {why}", 0, len(self.text)) from error

    def holds(self, roots: Mapping[str, object], variable: Callable[[str], object]) -> bool:
        """Return the value of a condition, which must be true or false."""
        value = self.evaluate(roots, variable)
        if not isinstance(value, bool):
            raise ExpressionError(
                f"a condition is true or false, but this is {show(value)}", 0, len(self.text)
            )
        return value

    def seen(
        self, roots: Mapping[str, object], variable: Callable[[str], object]
    ) -> dict[str, object]:
        """Return the value of each name in the expression, with the fields that are read of it.

        Names stand as they are written. A name without a value is left out. Raises nothing.
        """
        found: dict[str, object] = {}
        waiting: list[ast.AST] = [self.tree]
        while waiting:
            node = waiting.pop()
            inner = node
            while isinstance(inner, ast.Attribute | ast.Subscript):
                inner = inner.value
            named = isinstance(inner, ast.Name) and (
                inner.id in self.roots or self.variable_of(inner) is not None
            )
            if not named or not isinstance(node, ast.expr):
                waiting.extend(reversed(list(ast.iter_child_nodes(node))))
                continue
            start, end = self.span(node)
            text = self.text[start:end]
            try:
                found[text] = Expression(text, roots=self.roots).evaluate(roots, variable)
            except ExpressionError:
                continue
        return found

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Return the columns of a node of `tree` in `text`."""
        start, end = self.form.span(node)
        if self.form.text == self.text:
            return start, end
        return self._column(start), self._column(end - 1) + 1

    def _column(self, at: int) -> int:
        """Return the column in `text` of a column in the form's text, where every name is `v`."""
        starts = [self.form.span(node)[0] for node in self.form.variables.values()]
        return at + sum(
            len(name) - 1 for name, start in zip(self.variables, starts, strict=True) if start < at
        )

    def reads_field_of(self, name: str) -> bool:
        """Return whether the expression reads a field of a variable, as of a message."""
        return any(
            isinstance(node, ast.Attribute) and self.variable_of(node.value) == name
            for node in ast.walk(self.tree)
        )

    def variable_of(self, node: ast.AST) -> str | None:
        """Return the variable a node of `tree` reads, or None."""
        at = self.form.number_of(node)
        return None if at is None else self.variables[at]
