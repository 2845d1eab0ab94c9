"""The form of an expression: its text parsed and compiled, shared by many expressions.

No ROS here. Python's own ``ast`` does the parsing. Only nodes that `Form._compile` lists are let
through, and each becomes a closure. An error names what is wrong with a text, and where.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Mapping

from bt_actions.expressions.functions import ARGUMENTS, FUNCTIONS, KNOWN, instead_of, listed
from bt_actions.expressions.text import ExpressionError, foreign_in, translate
from bt_actions.expressions.values import (
    BINARY,
    COMPARE,
    MAX_BITS,
    UNARY,
    bounded,
    cut,
    field,
    item,
    truth,
)
from bt_actions.utilities.plain_data import plain

_MAX_DEPTH = 60
_INFINITE = float("inf")
_CONSTANTS = {"true": True, "false": False, "True": True, "False": False}
_ANSWERS = frozenset({"result", "feedback", "message"})
_SAVE = "save what it holds, and read that as $name"
_ASKED = "known($name) is true where there is a value"
_EXAMPLE = "MoveRobot.Result.STATUS_FAULT"
_FOREIGN = {
    "null": f"there is no 'null' here: {_ASKED}",
    "TRUE": "write 'true'",
    "FALSE": "write 'false'",
}
_INTERFACE = re.compile(r"[a-z]\w*(?:/(?:msg|srv|action))?/(?P<constant>[A-Z]\w*(?:\.\w+)+)")
_PERCENT = re.compile(
    r"(?<![\w.$])(\d+(?:\.\d+)?) *(?:%|percent\b)(?= *(?:$|[)\],<>=!]|and\b|or\b))"
)
"""A percent sign that is not the remainder of a division."""
_COMPARED = re.compile(r"(?:[=!]=|[\[,]) *\Z")
"""The place before a word that may be meant as a text."""
Variable = Callable[[str], object]
_Roots = Mapping[str, object]
_Names = tuple[str, ...]
_Closure = Callable[[_Roots, Variable, _Names], object]


class Form:
    """A text that was parsed and compiled, for all expressions that differ in names alone."""

    __slots__ = ("_constants", "_source", "asked", "constants", "evaluate", "roots", "text",
                 "tree", "variables")  # fmt: skip

    def __init__(
        self, text: str, roots: frozenset[str], constants: Callable[[str], object] | None
    ) -> None:
        self.text = text
        self.roots = roots
        self._constants = constants
        self.constants: list[str] = []
        self._source = translate(text)
        self.tree = self._parse()
        self.variables: dict[int, ast.Name] = {}
        """The nodes that read a variable, by their places, in reading order."""
        self.asked: set[int] = set()
        """The places of the variables that `known` asks for."""
        self.evaluate = self._compile(self.tree, 0)

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Return the columns of a node of `tree` in `text`."""
        origin, end = self._source.origin, node.end_col_offset or 1
        return origin[node.col_offset], origin[end - 1] + 1

    def number_of(self, node: ast.AST) -> int | None:
        """Return the number, in reading order, of the variable that `node` reads, or None."""
        if isinstance(node, ast.Name) and node.col_offset in self._source.variables:
            return [*self.variables].index(node.col_offset)
        return None

    def constant_of(self, node: ast.AST) -> str | None:
        """Return the dotted name of the constant that a node of `tree` stands for, or None."""
        names: list[str] = []
        inner = node
        while isinstance(inner, ast.Attribute):
            names.append(inner.attr)
            inner = inner.value
        if self._constants is None or not names or not isinstance(inner, ast.Name):
            return None
        if not (names[0].isupper() and inner.id[0].isupper()) or inner.id in self.roots:
            return None
        return ".".join([inner.id, *reversed(names)])

    def constant(self, name: str) -> object:
        """Return the value of a constant by its dotted name. Raises ValueError."""
        assert self._constants is not None
        return self._constants(name)

    def _parse(self) -> ast.expr:
        source = self._source
        try:
            tree = ast.parse(source.text.rstrip(), mode="eval").body
        except SyntaxError as error:
            if foreign := foreign_in(self.text):
                raise foreign from None
            if percent := _PERCENT.search(self.text):
                said = f"{percent[0]!r}: write {float(percent[1]) / 100:g}"
                raise ExpressionError(said, *percent.span()) from None
            at = error.offset - 1 if error.offset else len(source.text)
            column = source.origin[min(at, len(source.text))]
            raise ExpressionError(_syntax(self.text, column, error), column) from None
        except (RecursionError, MemoryError, ValueError):
            raise ExpressionError("nested too deep", 0, len(self.text)) from None
        for node in ast.walk(tree) if "._" in source.text else ():
            if isinstance(node, ast.Attribute):  # as it was written: `translate` may change it
                end = self.span(node)[1]
                node.attr = self.text[end - len(node.attr) : end]
        return tree

    def _compile(self, node: ast.expr, depth: int) -> _Closure:
        if depth > _MAX_DEPTH:
            raise ExpressionError("nested too deep", *self.span(node))

        def part(inner: ast.expr) -> _Closure:
            return self._compile(inner, depth + 1)

        match node:
            case ast.Constant(value=bool() | int() | float() | str() as value):
                large = isinstance(value, int) and value.bit_length() > MAX_BITS
                if large or value == _INFINITE:
                    raise ExpressionError("this number is too large", *self.span(node))
                return _constant(value)
            case ast.Name():
                return self._compile_name(node)
            case ast.Attribute() if (name := self.constant_of(node)) is not None:
                self.constants.append(name)
                return self._guard(node, self.constant, _constant(name))
            case ast.Attribute(value=inner, attr=attr):
                if attr.startswith("_"):
                    raise self._refusal(
                        node, f"{attr!r}: names with a leading underscore are private"
                    )
                return self._guard(node, field, part(inner), _constant(attr))
            case ast.Subscript(value=inner, slice=ast.Slice(lower=start, upper=end, step=None)):
                parts = (_NOTHING if each is None else part(each) for each in (inner, start, end))
                return self._guard(node, cut, *parts)
            case ast.Subscript(value=inner, slice=index) if not isinstance(index, ast.Slice):
                return self._guard(node, item, part(inner), part(index))
            case ast.UnaryOp(op=op, operand=inner) if type(op) in UNARY:
                return self._guard(node, UNARY[type(op)], part(inner))
            case ast.BinOp(left=left, op=binary, right=right) if type(binary) in BINARY:
                return self._guard(node, BINARY[type(binary)], part(left), part(right))
            case ast.BoolOp(op=bool_op, values=values):
                return self._compile_bool(isinstance(bool_op, ast.And), values, part)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                then, asked, otherwise = part(body), part(test), part(orelse)  # in reading order
                return _either(self._guard(test, truth, asked), then, otherwise)
            case ast.Compare(left=left, ops=ops, comparators=rights):
                return self._compile_compare(node, [left, *rights], ops, part)
            case ast.List(elts=items) | ast.Tuple(elts=items):
                return _listing([part(item) for item in items])
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in ARGUMENTS:
                self._refuse_arguments(node, name, args)
                if name == KNOWN:
                    return self._compile_known(args[0], part)
                return self._guard(node, FUNCTIONS[name], *(part(arg) for arg in args))
            case ast.Call(func=function, args=args) if meant := self._meant(function, args):
                raise self._refusal(node, f"write {meant}")
        raise self._refusal(node, _why_not(node))

    def _compile_name(self, node: ast.Name) -> _Closure:
        if node.col_offset in self._source.variables:
            self.variables[node.col_offset] = node
            return _lookup(len(self.variables) - 1, node)
        if node.id in _CONSTANTS:
            return _constant(_CONSTANTS[node.id])
        if node.id not in self.roots:
            start, end = self.span(node)
            if path := _INTERFACE.match(self.text, start):
                text = f"a constant is written with the name of its type alone: {path['constant']}"
                raise ExpressionError(text, *path.span())
            compared = _COMPARED.search(self.text, 0, start) is not None
            raise ExpressionError(_unknown_name(node.id, self.roots, compared), start, end)
        return _root(node)

    def _refuse_arguments(self, node: ast.expr, name: str, args: list[ast.expr]) -> None:
        most = ARGUMENTS[name]
        if not args:
            raise self._refusal(node, f"{name}() needs a value")
        if most and len(args) > most:
            takes = "one value" if most == 1 else f"at most {most} values"
            raise self._refusal(node, f"{name}() takes {takes}, not {len(args)}")

    def _compile_known(self, node: ast.expr, part: Callable[[ast.expr], _Closure]) -> _Closure:
        """Return a closure that tells whether a part has a value, and never fails."""
        if not isinstance(node, (ast.Name, ast.Attribute, ast.Subscript)):
            raise self._refusal(node, "known() asks for one value: known($name), known($a.b.0)")
        before = len(self.variables)
        read = part(node)
        self.asked.update([*self.variables][before:])

        def known(roots: _Roots, variable: Variable, names: _Names) -> object:
            try:
                read(roots, variable, names)
            except (Failed, ExpressionError):
                return False
            return True

        return known

    def _meant(self, function: ast.expr, args: list[ast.expr]) -> str | None:
        """Return what to write for a function or a method of another language."""
        given = [self.text[slice(*self.span(arg))] for arg in args]
        match function:
            case ast.Name(id=name):
                return instead_of(name, None, given)
            case ast.Attribute(value=inner, attr=name):
                return instead_of(name, self.text[slice(*self.span(inner))], given)
        return None

    def _compile_bool(
        self, is_and: bool, values: list[ast.expr], part: Callable[[ast.expr], _Closure]
    ) -> _Closure:
        parts = [self._guard(value, truth, part(value)) for value in values]
        if is_and:
            return lambda roots, variable, names: all(p(roots, variable, names) for p in parts)
        return lambda roots, variable, names: any(p(roots, variable, names) for p in parts)

    def _compile_compare(
        self,
        node: ast.expr,
        operands: list[ast.expr],
        ops: list[ast.cmpop],
        part: Callable[[ast.expr], _Closure],
    ) -> _Closure:
        tests = []
        for op in ops:
            if type(op) not in COMPARE:
                raise self._refusal(node, "write '==' or '!=' instead of 'is'")
            tests.append(COMPARE[type(op)])
        parts = [part(operand) for operand in operands]

        def compare(roots: _Roots, variable: Variable, names: _Names) -> object:
            left = plain(parts[0](roots, variable, names))
            for test, right_part in zip(tests, parts[1:], strict=True):
                right = plain(right_part(roots, variable, names))
                try:
                    if not test(left, right):
                        return False
                except Exception as error:
                    raise Failed(node, error) from error
                left = right
            return True

        return compare

    def _guard(self, node: ast.expr, function: Callable[..., object], *parts: _Closure) -> _Closure:
        """Return a closure that applies `function`, and puts the place of `node` on its error."""

        def apply(roots: _Roots, variable: Variable, names: _Names) -> object:
            values = [part(roots, variable, names) for part in parts]
            try:
                return bounded(function(*values))
            except Exception as error:
                raise Failed(node, error) from error

        return apply

    def _refusal(self, node: ast.expr, message: str) -> ExpressionError:
        return ExpressionError(message, *self.span(node))


class Failed(Exception):
    """A part of an expression without a value, and the reason."""

    def __init__(self, node: ast.expr, why: str | Exception) -> None:
        self.node = node
        self.why = why


def _constant(value: object) -> _Closure:
    return lambda _roots, _variable, _names: value


_NOTHING = _constant(None)


def _either(asked: _Closure, then: _Closure, otherwise: _Closure) -> _Closure:
    return lambda *known: (then if asked(*known) else otherwise)(*known)


def _listing(parts: list[_Closure]) -> _Closure:
    return lambda roots, variable, names: [part(roots, variable, names) for part in parts]


def _lookup(at: int, node: ast.Name) -> _Closure:
    def read(_roots: _Roots, variable: Variable, names: _Names) -> object:
        try:
            return variable(names[at])
        except KeyError:
            raise Failed(node, f"${names[at]} has no value") from None

    return read


def _root(node: ast.Name) -> _Closure:
    def read(roots: _Roots, _variable: Variable, _names: _Names) -> object:
        try:
            return roots[node.id]
        except KeyError:
            raise Failed(node, f"there is no {node.id} here") from None

    return read


def _syntax(text: str, column: int, error: SyntaxError) -> str:
    if text.lstrip().startswith("= "):
        return "an expression stands here without '=' before it"
    for at in (column, column - 1):
        around = text[max(at - 1, 0) : at + 2]
        if text[at : at + 1] == "=" and "==" not in around and around[0] not in "<>!":
            return "'=' alone compares nothing: write '=='"
    message = (error.msg or "not an expression").removesuffix(". Perhaps you forgot a comma?")
    if "==" in message:
        return "'=' alone compares nothing: write '=='"
    if "never closed" in message or "unmatched" in message:
        return message
    return "this is not an expression"


def _unknown_name(name: str, roots: Iterable[str], compared: bool) -> str:
    known = sorted(roots)
    if name in _FOREIGN:
        return _FOREIGN[name]
    if foreign := foreign_in(name):
        return foreign.message
    if name in _ANSWERS:
        instead = f"{', '.join(known)} can be used" if known else _SAVE
        return f"there is no {name} here: {instead}"
    given = "".join(f", a field {root}.{name}" for root in known)
    given += f", a text {name!r}" if compared else ""
    if name.isupper():
        given = f", and a constant with its type, such as {_EXAMPLE}"
    return f"unknown name {name!r}: a variable is written ${name}{given}"


def _why_not(node: ast.expr) -> str:
    if isinstance(node, ast.Call):
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if foreign := foreign_in(name):
            return foreign.message
        if name in ARGUMENTS:
            return f"{name}() takes values only, not {node.keywords[0].arg or '**'}="
        return f"only {listed()} can be called"
    if isinstance(node, ast.Constant) and node.value is None:
        return f"there is no 'None' here: {_ASKED}"
    names: dict[type[ast.expr], str] = {
        ast.Lambda: "a lambda",
        ast.Dict: "a mapping",
        ast.Set: "a set",
        ast.ListComp: "a comprehension",
        ast.GeneratorExp: "a comprehension",
        ast.Subscript: "a step",
        ast.JoinedStr: "an f-string",
        ast.NamedExpr: "':='",
        ast.Starred: "'*'",
        ast.Await: "'await'",
    }
    return f"{names.get(type(node), 'this')} cannot be used in an expression"
