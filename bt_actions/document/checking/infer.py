"""The type of an expression, as far as the types of its variables are known.

Mistakes go to a callback. An unknown type is None, and never a mistake.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence

from bt_actions.document.checking.value_types import (
    BOOL,
    FLOAT,
    INTEGER,
    ONE_VALUE,
    TEXT,
    common_type,
    comparable,
    has_length,
    is_float,
    is_number,
    is_text,
    joined,
    named,
    type_of_literal,
    unjoinable,
)
from bt_actions.document.language.types import Either, Record
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.values import BINARY, LENGTHS, bounded, number, reason
from bt_actions.messages.fields import (
    FLOATS,
    INTEGERS,
    FieldType,
    Listing,
    Message,
    Scalar,
    constants,
    describe,
    no_field,
)
from bt_actions.messages.interfaces import UnknownInterface, interface_name
from bt_actions.utilities.suggest import what_it_has

Wrong = tuple[str, str, int, int]
"""A rule's code, a message, and the columns in the expression's text."""
_VARIANCES = {f"covariance[{at}]": (0.0, math.inf) for at in range(0, 36, 7)}
"""The diagonal of a covariance over position and rotation."""
_RANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "geometry_msgs/msg/AccelWithCovariance": _VARIANCES,
    "geometry_msgs/msg/PoseWithCovariance": _VARIANCES,
    "geometry_msgs/msg/Quaternion": dict.fromkeys("xyzw", (-1.0, 1.0)),
    "geometry_msgs/msg/TwistWithCovariance": _VARIANCES,
    "sensor_msgs/msg/BatteryState": {"percentage": (0.0, 1.0)},
    "sensor_msgs/msg/NavSatFix": {"latitude": (-90.0, 90.0), "longitude": (-180.0, 180.0)},
    "sensor_msgs/msg/RelativeHumidity": {"relative_humidity": (0.0, 1.0)},
}
"""Fields of common messages that never leave a range, as their .msg files say: BT321.

A sensor's own covariance is not among them: Imu.msg says that -1 stands for an unknown one.
"""
_TURNED: Mapping[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Gt: ast.Lt, ast.GtE: ast.LtE
}  # fmt: skip


def infer(
    expression: Expression,
    roots: Mapping[str, FieldType | None],
    variable: Callable[[str], FieldType | None],
    *,
    types: bool = True,
) -> tuple[FieldType | None, list[Wrong]]:
    """Return the type of an expression's value, or None for an unknown one; and its mistakes.

    With `types=False` no constant of a message is looked up.
    """
    inference = _Inference(expression, roots, variable, types)
    return inference.any_type_of(expression.tree), inference.wrong


class _Inference:
    def __init__(
        self,
        expression: Expression,
        roots: Mapping[str, FieldType | None],
        variable: Callable[[str], FieldType | None],
        types: bool,
    ) -> None:
        self.wrong: list[Wrong] = []
        self._fields: dict[ast.expr, tuple[type, str]] = {}
        """The message and field behind each part of the expression that reads one."""
        self._types = types
        self._expression = expression
        self._roots = roots
        self._variable = variable

    def type_of(self, node: ast.expr) -> FieldType | None:
        """Return the one type of a part, or None."""
        kind = self.any_type_of(node)
        return None if isinstance(kind, Either) else kind

    def any_type_of(self, node: ast.expr) -> FieldType | None:
        """Return the type of a part, which may be one of several."""
        match node:
            case ast.Compare(left=left, ops=ops, comparators=rights):  # often asked for first
                self._compare([left, *rights], ops)
                return BOOL
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Constant(value=value):
                return type_of_literal(value)
            case ast.Attribute() if (
                constant := self._expression.form.constant_of(node)
            ) is not None:
                return self._constant(node, constant)
            case ast.Attribute(value=inner, attr=attr):
                return self._field(node, self.any_type_of(inner), attr)
            case ast.Subscript(value=inner, slice=ast.Slice(lower=start, upper=end)):
                return self._slice(node, self.type_of(inner), [start, end])
            case ast.Subscript(value=inner, slice=index):
                return self._item(node, self.type_of(inner), index)
            case ast.UnaryOp(op=ast.Not(), operand=inner):
                self._truth(inner)
                return BOOL
            case ast.UnaryOp(operand=inner):
                return self._number(inner)
            case ast.BinOp(left=left, op=op, right=right):
                self._computable(node)
                return self._arithmetic(left, op, right)
            case ast.BoolOp(values=values):
                for part in values:
                    self._truth(part)
                return BOOL
            case ast.IfExp(test=test, body=body, orelse=orelse):
                self._truth(test)
                return _one_of([self.any_type_of(body), self.any_type_of(orelse)])
            case ast.List(elts=items) | ast.Tuple(elts=items):
                kinds = [self.type_of(item) for item in items]
                same = kinds and kinds[0] is not None and all(kind == kinds[0] for kind in kinds)
                return Listing(kinds[0]) if same and kinds[0] is not None else None
            case ast.Call(func=ast.Name(id=name), args=args):
                return self._call(name, args)
        return None

    def _wrong(self, node: ast.expr, message: str, code: str = "BT206") -> None:
        start, end = self._expression.span(node)
        if code in ("BT203", "BT313") and isinstance(node, ast.Attribute):
            start = max(start, end - len(node.attr))
        self.wrong.append((code, message, start, end))

    def _name(self, node: ast.expr, name: str) -> FieldType | None:
        variable = self._expression.variable_of(node)
        if variable is not None:
            return self._variable(variable)
        if name in ("true", "false"):
            return BOOL
        return self._roots.get(name)

    def _constant(self, node: ast.Attribute, name: str) -> FieldType | None:
        if not self._types:
            return None
        try:
            return type_of_literal(self._expression.form.constant(name))
        except UnknownInterface as error:
            self.wrong.append(("BT203", str(error), *self._expression.span(node.value)))
        except ValueError as error:
            self._wrong(node, str(error), "BT203")
        return None

    def _field(self, node: ast.expr, owner: FieldType | None, name: str) -> FieldType | None:
        if owner is None:
            return None
        if isinstance(owner, Either):
            return common_type([self._field(node, kind, name) for kind in owner.kinds])
        if isinstance(owner, Record):
            return self._key(node, owner, name)
        if not isinstance(owner, Message):
            remedy = ""
            if name in LENGTHS and isinstance(node, ast.Attribute) and has_length(owner):
                start, end = self._expression.span(node.value)
                remedy = f": write len({self._expression.text[start:end]})"
            self._wrong(node, f"{named(owner)} has no field {name!r}{remedy}", "BT203")
            return None
        known = describe(owner.cls)
        if name in known:
            self._fields[node] = owner.cls, name
            return known[name]
        if name in constants(owner.cls):
            return type_of_literal(constants(owner.cls)[name])
        self._wrong(node, no_field(owner.cls, name), "BT203")
        return None

    def _key(self, node: ast.expr, owner: Record, name: str) -> FieldType | None:
        known = dict(owner.items)
        if name not in known:
            near = what_it_has(name, known)
            self._wrong(node, f"this mapping has no key {name!r}{near}", "BT203")
        elif name in owner.sometimes and not self._asks_for(name):
            self._wrong(node, f"not every item has the key {name!r}", "BT313")
        return known.get(name)

    def _asks_for(self, name: str) -> bool:
        """Return whether the expression asks for a key: ``'quick' in $item and $item.quick``."""
        for part in ast.walk(self._expression.tree):
            match part:
                case ast.Compare(left=ast.Constant(value=asked)) if asked == name:
                    return True
                case ast.Call(func=ast.Name(id="known"), args=[ast.Attribute(attr=asked)]):
                    if asked == name:
                        return True
        return False

    def _item(self, node: ast.expr, owner: FieldType | None, index: ast.expr) -> FieldType | None:
        kind = self.type_of(index)
        if owner is None:
            return None
        literal = index.value if isinstance(index, ast.Constant) else None
        if isinstance(owner, Record) and isinstance(literal, str):
            return self._key(node, owner, literal)
        if isinstance(owner, Record) and (kind is None or is_text(kind)):
            return None
        if isinstance(owner, Scalar) and is_text(owner):
            return TEXT
        if not isinstance(owner, Listing):
            field = isinstance(owner, Message) and isinstance(literal, str)
            remedy = f": write .{literal!s}" if field else ""
            self._wrong(node, f"{named(owner)} has no items{remedy}")
            return None
        self._index(index, kind)
        if isinstance(node, ast.Subscript) and node.value in self._fields:
            cls, name = self._fields[node.value]
            self._fields[node] = cls, f"{name}[{literal!r}]"
        size = owner.size
        if size is not None and isinstance(literal, int) and not -size <= literal < size:
            self._wrong(node, f"index {literal} is outside of {size} items")
        return owner.item

    def _index(self, node: ast.expr, kind: FieldType | None, what: str = "an index") -> None:
        if kind is not None and not (isinstance(kind, Scalar) and kind.name in INTEGERS):
            self._wrong(node, f"{what} is a whole number, not {named(kind)}")

    def _slice(
        self, node: ast.expr, owner: FieldType | None, bounds: list[ast.expr | None]
    ) -> FieldType | None:
        for bound in bounds:
            if bound is not None:
                self._index(bound, self.type_of(bound))
        if owner is None or is_text(owner):
            return owner
        if isinstance(owner, Listing):
            return Listing(owner.item)
        self._wrong(node, f"{named(owner)} has no items")
        return None

    def _truth(self, node: ast.expr) -> None:
        kind = self.type_of(node)
        if kind is not None and kind != BOOL:
            self._wrong(node, f"true or false is needed, not {named(kind)}")

    def _number(self, node: ast.expr) -> FieldType | None:
        kind = self.type_of(node)
        if kind is not None and not is_number(kind):
            self._wrong(node, f"a number is needed, not {named(kind)}")
            return None
        return kind

    def _arithmetic(self, left: ast.expr, op: ast.operator, right: ast.expr) -> FieldType | None:
        if isinstance(op, ast.Add):
            first, second = self.type_of(left), self.type_of(right)
            if not (is_number(first) and is_number(second)):
                return self._joined((left, first), (right, second))
        else:
            first, second = self._number(left), self._number(right)
        if first is None or second is None:
            return None
        both = {kind.name for kind in (first, second) if isinstance(kind, Scalar)}
        if isinstance(op, ast.Div) or both & set(FLOATS):
            return FLOAT
        return _power(right, second) if isinstance(op, ast.Pow) else INTEGER

    def _joined(self, *sides: tuple[ast.expr, FieldType | None]) -> FieldType | None:
        """Return the type of a sum that may be one of lists or texts."""
        lists_first = sorted(sides, key=lambda side: not isinstance(side[1], Listing))
        for (_, kind), (other, given) in (lists_first, lists_first[::-1]):
            text = self._expression.text[slice(*self._expression.span(other))]
            if isinstance(kind, Listing):
                if given is not None and (said := unjoinable(kind, given)):
                    remedy = "" if isinstance(given, Listing) else f": write [{text}]"
                    if isinstance(other, ast.List) and is_text(kind.item):
                        remedy = f": write [str({text[1:-1]})]" if len(other.elts) == 1 else ""
                    self._wrong(other, f"{said}, not {named(given)}{remedy}")
                    return None
                return None if given is None else joined(kind, given)
            if is_text(kind):
                if given is not None and not is_text(given):
                    remedy = f": write str({text})" if is_number(given) or given == BOOL else ""
                    self._wrong(other, f"a text is joined with a text, not {named(given)}{remedy}")
                    return None
                return TEXT
        for node, kind in sides:
            if kind is not None and not is_number(kind):
                self._wrong(node, f"a number is needed, not {named(kind)}")
        return None

    def _computable(self, node: ast.BinOp) -> None:
        """Report what fails for any values of the variables: `1 / 0 > $n`, `$n % 0`."""
        left, right = _number_of(node.left), _number_of(node.right)
        if left is None and isinstance(node.op, (ast.Div, ast.FloorDiv, ast.Mod)):
            left = 1  # any number will do
        if left is None or right is None:
            return
        try:
            bounded(BINARY[type(node.op)](left, right))
        except (ValueError, ArithmeticError) as error:
            start, end = self._expression.span(node)
            self._wrong(node, reason(error, self._expression.text[start:end]))

    def _compare(self, operands: list[ast.expr], ops: list[ast.cmpop]) -> None:
        kinds = [self.type_of(operand) for operand in operands]
        for at, op in enumerate(ops):
            self._in_range(operands[at], op, operands[at + 1])
            first, second = kinds[at], kinds[at + 1]
            if first is None or second is None:
                continue
            right = operands[at + 1]
            if isinstance(op, (ast.In, ast.NotIn)):
                if isinstance(second, Listing):
                    if not comparable(first, second.item):
                        self._wrong(right, f"{named(first)} is never among {second.item}")
                elif not (is_text(first) and (is_text(second) or isinstance(second, Record))):
                    self._wrong(right, f"{named(second)} holds nothing that 'in' could look for")
            elif not comparable(first, second):
                self._wrong(right, f"{named(first)} is never compared with {named(second)}")
            elif not isinstance(op, (ast.Eq, ast.NotEq)) and not (
                is_number(first) or is_text(first)
            ):
                self._wrong(
                    operands[at], f"{named(first)} is neither less nor greater than another"
                )

    def _in_range(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> None:
        for field, other in ((left, right), (right, left)):
            number = _number_of(other) if field in self._fields else None
            if number is None:
                continue
            if said := _never_held(*self._fields[field], op, number, first=field is left):
                self._wrong(other, said, "BT321")

    def _call(self, name: str, args: list[ast.expr]) -> FieldType | None:
        if name in ONE_VALUE:
            wanted, lacks, gives = ONE_VALUE[name]
            kind = self.type_of(args[0])
            if not (kind is None or wanted(kind)):
                self._wrong(args[0], lacks.format(named(kind)))
            return gives
        if name in ("abs", "round", "sqrt"):
            kind = self._number(args[0])
            if name == "sqrt":
                return FLOAT
            for digits in args[1:]:
                self._index(digits, self.type_of(digits), "a number of digits")
            return INTEGER if name == "round" and len(args) == 1 else kind
        kinds = [self.type_of(arg) for arg in args]
        if len(kinds) == 1:
            only = kinds[0]
            if only is not None and not isinstance(only, Listing):
                self._wrong(args[0], f"{name} of one value needs a list, not {named(only)}")
            return only.item if isinstance(only, Listing) else None
        known = [(arg, kind) for arg, kind in zip(args, kinds, strict=True) if kind is not None]
        for arg, kind in known[1:]:
            first = known[0][1]
            if not comparable(first, kind):
                self._wrong(arg, f"{named(first)} is never compared with {named(kind)}")
        kind = _one_of(kinds)
        return None if isinstance(kind, Either) else kind


def _one_of(kinds: Sequence[FieldType | None]) -> FieldType | None:
    """Return the type of a value that has one of these types."""
    if all(is_number(kind) for kind in kinds):
        return FLOAT if any(is_float(kind) for kind in kinds) else INTEGER
    return common_type(kinds)


def _power(exponent: ast.expr, kind: FieldType) -> FieldType | None:
    """Return the type of a whole number to a power; None where the exponent may be below zero."""
    value = _number_of(exponent)
    if value is not None:
        return FLOAT if value < 0 else INTEGER
    return INTEGER if isinstance(kind, Scalar) and INTEGERS[kind.name][0] == 0 else None


def _number_of(node: ast.expr) -> int | float | None:
    """Return the number that a part of an expression gives without a variable."""
    try:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return value
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                positive = _number_of(inner)
                return None if positive is None else -positive
            case ast.BinOp(left=first, op=op, right=second):
                left, right = _number_of(first), _number_of(second)
                if left is not None and right is not None:
                    return number(bounded(BINARY[type(op)](left, right)))
    except (ValueError, ArithmeticError):
        pass  # reported at the part itself
    return None


def _never_held(cls: type, name: str, op: ast.cmpop, number: float, *, first: bool) -> str | None:
    """Say why a comparison of a field with a number never holds; `first` for the field first."""
    allowed = _RANGES.get(interface_name(cls), {}).get(name)
    kind = type(op) if first else _TURNED.get(type(op), type(op))
    if allowed is None or kind not in (*_TURNED, ast.Eq, ast.NotEq):
        return None
    least, most = allowed
    above = number > most or (number == most and kind is ast.Gt)
    if not above and number >= least:
        return None
    ordered = kind in _TURNED
    holds = (kind in (ast.Lt, ast.LtE)) is above if ordered else kind is ast.NotEq
    outcome = "true" if holds else "false"
    percent = f"; write {number / 100:g}" if allowed == (0.0, 1.0) and 2 <= number <= 100 else ""
    span = f"{least:g} to {most:g}" if most < math.inf else f"at least {least:g}"
    return f"{cls.__name__}.{name} is {span}: this is always {outcome}{percent}"
