"""The rules of expressions, as sentences."""

from __future__ import annotations

import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_actions.expressions.expression import MAX_LENGTH, Expression
from bt_actions.expressions.text import ExpressionError

RESULT = SimpleNamespace(
    stalled=True,
    position=4.0,
    message="done",
    poses=[
        SimpleNamespace(x=1.5),
        {"x": 2},
        {"not": {"except": False}},
    ],
)
VARIABLES: dict[str, Any] = {
    "a": 1,
    "b": 2.5,
    "on": True,
    "list": [10, 20, 30],
    "where": {"pose": {"x": 7}},
    "big": 2**200,
    "raw": array.array("d", [1.0, 2.0]),
    "words": {"from": 1, "class": {"in": 5}, "None": 2, "is": "x.from", "if": 5, "fromage": 9},
    "from": 3,
    "class": True,
    "matrix": np.array([0.5, 0.5]),
    "bytes": [b"\x01", b"\x02"],
    "pair": (7, 8),
    "singles": array.array("f", [0.7, 0.1]),
    "single": np.float32(0.7),
    "long": [0] * 60_000,
    "text": "a" * 10_000,
}


def value(text: str) -> object:
    expression = Expression(text, roots=frozenset({"result"}))
    return expression.evaluate({"result": RESULT}, VARIABLES.__getitem__)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("result.stalled", True),
        ("result.position == 4", True),
        ("not result.stalled", False),
        ("result.stalled and $a < 2", True),
        ("$a < 2 < $b", True),
        ("$a + 1", 2),
        ("$a+$b*2", 6.0),
        ("$a +\n\t$b", 3.5),
        ("-$a ** 2", -1),
        ("2 ** -1", 0.5),
        ("7 // 2 + 7 % 4", 6),
        ("$a in [1, 2]", True),
        ("'on' in result.message", True),
        ("$a not in (1, 2)", False),
        ("$list.1", 20),
        ("$list[2]", 30),
        ("$list.0 + $list.1", 30),
        ("$where.pose.x", 7),
        ("$where['pose'].x", 7),
        ("result.poses.0.x", 1.5),
        ("result.poses.1.x", 2),
        ("result.poses[0].x + .5", 2.0),
        ("1.5 + 1.25", 2.75),
        ("len($list) == 3", True),
        ("max($a, $b)", 2.5),
        ("min($list)", 10),
        ("abs(-3)", 3),
        ("$list + [$a]", [10, 20, 30, 1]),
        ("[] + ($a, $a)", [1, 1]),
        ("$raw + [$b] + $raw", [1.0, 2.0, 2.5, 1.0, 2.0]),
        ("$matrix + $bytes + $pair", [0.5, 0.5, 1, 2, 7, 8]),
        ("result.message + ' ' + str($a) + str($on) + str(0.7)", "done 1true0.7"),
        ("$list[1:3]", [20, 30]),
        ("$singles.0 == 0.7 and $single == 0.7 and $singles == [0.7, 0.1]", True),
        ("$singles[1:] + [max($singles)]", [0.1, 0.7]),
        ("str($single)", "0.7"),
        ("$list[:-1] + $list[5:]", [10, 20]),
        ("$raw[$a:]", [2.0]),
        ("$matrix[:1]", [0.5]),
        ("$list[-1]", 30),
        ("result.message[1:3]", "on"),
        ("1 if $on else $gone", 1),
        ("$gone if not $on else 'a' if $a == 1 else 2", "a"),
        ("sqrt(9) + sqrt($big - $big)", 3.0),
        ("round($b)", 2),
        ("round(2.34567, 2)", 2.35),
        ("round(7, 2)", 7),
        ("int($b)", 2),
        ("int(' -12 ')", -12),
        ("float('2.5') + float($a)", 3.5),
        ("known($a)", True),
        ("known($gone)", False),
        ("known($gone.x) or known($list.7) or known($where.gone)", False),
        ("known($list[$gone])", False),
        ("known(result.poses.0.x) and not known(result.poses.0.y)", True),
        ("known($gone) and $gone > 3", False),
        ("$raw == [1, 2]", True),
        ("$raw.1", 2.0),
        ("true and True", True),
        ("$raw.1in[2]or '1and' == ''", True),
        ("false or False", False),
        ("'$a' == \"$a\"", True),
        ("'ä' == 'ä'", True),
        ("  $a\n  ==  1 ", True),
        ("$on", True),
        ("$words.from + $words.class.in - $words.None", 4),
        ("'.from' in $words.is and $words['if'] == 5", True),
        ("result.poses.2.not.except or ( $words ).from < $words.fromage", True),
        ("$from == 3 and $class", True),
    ],
)
def test_an_expression_has_the_value_python_gives_it(text: str, expected: object) -> None:
    assert value(text) == expected
    assert type(value(text)) is type(expected)


@pytest.mark.parametrize(
    ("text", "message", "column"),
    [
        ("", "an empty expression", 0),
        ("result.stalled = true", "'=' alone compares nothing: write '=='", 15),
        ("$a && $b", "'&&': write 'and'", 3),
        ("!$a", "'!': write 'not $a'", 0),
        ("!($a)", "'!': write 'not'", 0),
        ("$a | $b", "'|': write 'or'", 3),
        ("$on AND $a == 1", "write 'and'", 4),
        ("'x AND' == 'y' Or $on", "write 'or'", 15),
        ("NOT $on", "write 'not'", 0),
        ("NOT($on)", "write 'not'", 0),
        ("$a === 1", "'===': write '=='", 3),
        ("$a !== 1", "'!==': write '!='", 3),
        ("$b < 20 % and $a == 1", "'20 %': write 0.2", 5),
        ("$b > 12.5%", "'12.5%': write 0.125", 5),
        ("length($list) > 1", "write len($list)", 0),
        ("string($a) == '1'", "write str($a)", 0),
        ("$list.append($a + 1)", "write $list + [$a + 1]", 0),
        ("append($list, $a)", "write $list + [$a]", 0),
        ("$list.extend($list)", "write $list + $list", 0),
        ("isset($a)", "write known($a)", 0),
        ("1 < result.poses.size()", "write len(result.poses)", 4),
        (
            "$a == sensor_msgs/msg/BatteryState.FULL",
            "a constant is written with the name of its type alone: BatteryState.FULL",
            6,
        ),
        (
            "$where == ab",
            "unknown name 'ab': a variable is written $ab, a field result.ab, a text 'ab'",
            10,
        ),
        ("$words.from.class = 2", "'=' alone compares nothing: write '=='", 18),
        ("$words.from.class and there", None, 22),
        ("$a # why", "'#': a comment has no place in an expression", 3),
        (
            "pick_at > 1",
            "unknown name 'pick_at': a variable is written $pick_at, a field result.pick_at",
            0,
        ),
        ("$1", "a dollar sign begins a name: write $name", 0),
        (
            "$a > 1 and __import__('os')",
            "only len, abs, min, max, round, sqrt, int, float, str and known can be called",
            11,
        ),
        ("result.__class__", "'__class__': names with a leading underscore are private", 0),
        ("_a", "unknown name '_a': a variable is written $_a, a field result._a", 0),
        ("len()", "len() needs a value", 0),
        ("max($a, key=len)", "max() takes values only, not key=", 0),
        ("$a == null", "there is no 'null' here: known($name) is true where there is a value", 6),
        ("feedback.x > 1", "there is no feedback here: result can be used", 0),
        ("$a > 1and true", "a space is missing before 'and'", 6),
        ("'1and' == '' or 0xfor 1", "a space is missing before 'or'", 19),
        ("1.5e3if 2", "a space is missing before 'if'", 5),
        ("[x for x in $list]", "a comprehension cannot be used in an expression", 0),
        ("(lambda: 1)", "a lambda cannot be used in an expression", 1),
        ("$a is 1", "write '==' or '!=' instead of 'is'", 0),
        ("$on ? 1 : 2", "'?': write 'A if CONDITION else B'", 4),
        ("$list[0:1:2]", "a step cannot be used in an expression", 0),
        ("round($b, 1, 2)", "round() takes at most 2 values, not 3", 0),
        ("known()", "known() needs a value", 0),
        ("known($a > 1)", "known() asks for one value: known($name), known($a.b.0)", 6),
        ("f'{x}'", "an f-string cannot be used in an expression", 0),
        ("'abc", "this text has no closing quote", 0),
        ("'a\\n'", "a text here holds no backslash and no line break", 2),
        ("None", "there is no 'None' here: known($name) is true where there is a value", 0),
        ("$ä", "a dollar sign begins a name: write $name", 0),
        ("(1", "'(' was never closed", 0),
        ("1 +", "this is not an expression", 3),
        ("9" * 100, "this number is too large", 0),
        ("1 < 1e400", "this number is too large", 4),
        ("(" * 300 + "1" + ")" * 300, "this is not an expression", None),
        ("+" * 1000 + "1", "nested too deep", None),
        ("1" * (MAX_LENGTH + 1), f"longer than {MAX_LENGTH} characters", 0),
    ],
)
def test_what_is_no_expression_is_refused_with_its_place(
    text: str, message: str | None, column: int | None
) -> None:
    with pytest.raises(ExpressionError) as caught:
        Expression(text)
    assert message is None or caught.value.message == message
    if column is not None:
        assert caught.value.column == column
    assert caught.value.end_column > caught.value.column


@pytest.mark.parametrize(
    ("text", "message", "span"),
    [
        ("1 + $gone", "$gone has no value", (4, 9)),
        ("$a / 0", "$a / 0 divides by zero", (0, 6)),
        ("1 == 1 and $a.x", "1 has no field 'x'", (11, 15)),
        ("$where.poze", "no key 'poze'; there is pose", (0, 11)),
        ("$words.class.from", "no key 'from'; there is in", (0, 17)),
        ("$list.length", "[10, 20, 30] has no field 'length': write len(...)", (0, 12)),
        ("$list.7", "index 7 is outside of 3 items", (0, 7)),
        ("$list.0.0", "10 has no items", (0, 9)),
        ("$big * $big", "the number is too large", (0, 11)),
        ("9 ** 9 ** 9", "the number would be too large", (0, 11)),
        ("'a' * 9", "a number is needed, not 'a'", (0, 7)),
        ("'a' < 1", "a number is needed, not 'a'", (0, 7)),
        ("not 3", "true or false is needed, not 3", (0, 5)),
        ("$a and $on", "true or false is needed, not 1", (0, 2)),
        ("1 if $a else 2", "true or false is needed, not 1", (5, 7)),
        ("1 + (2 if $on else $gone) + (3 if false else $gone)", "$gone has no value", (45, 50)),
        ("sqrt(1 - 3)", "-2 has no square root", (0, 11)),
        ("len(3)", "3 has no length", (0, 6)),
        ("['part ' + $a]", "a text is joined with a text: write str(...) around 1", (1, 13)),
        ("'c' + $list", "a list is joined with a list: write [...] around 'c'", (0, 11)),
        ("$text + 'c'", "the text would have more than 10,000 characters", (0, 11)),
        ("$list + $a", "a list is joined with a list: write [...] around 1", (0, 10)),
        ("1 + $long + 1", "a list is joined with a list: write [...] around 1", (0, 9)),
        ("$long + $long", "the list would have more than 100,000 items", (0, 13)),
        ("$list['a':]", "an index is a whole number, not 'a'", (0, 11)),
        ("$a[1:]", "1 has no items", (0, 6)),
        ("$where[1:]", "{pose: {x: 7}} has no items", (0, 10)),
        ("int('x')", "'x' is no whole number", (0, 8)),
        ("int('1e999')", "'1e999' is no whole number", (0, 12)),
        ("int(float('1e999'))", "inf is no whole number", (0, 19)),
        ("float('1_0')", "'1_0' is no number", (0, 12)),
        ("float('inf')", "'inf' is no number", (0, 12)),
        ("int($list)", "a number, or a text that holds one, is needed, not [10, 20, 30]", (0, 10)),
        ("float('x')", "'x' is no number", (0, 10)),
        ("float($on)", "a number, or a text that holds one, is needed, not true", (0, 10)),
        ("round($b, 99)", "round() takes 0 to 15 digits, not 99", (0, 13)),
        ("str($list)", "str() is of a number, a text, true or false, not [10, 20, 30]", (0, 10)),
        ("min([])", "min() of an empty list", (0, 7)),
        ("max(3)", "max() of one value needs a list, not 3", (0, 6)),
        ("max(1, 'a')", "max() is of numbers alone, or of texts alone", (0, 11)),
        ("abs('a')", "a number is needed, not 'a'", (0, 8)),
        ("'größer' + abs('ß')", "a number is needed, not 'ß'", (11, 19)),
        ("result.nothing", None, (0, 14)),
    ],
)
def test_what_has_no_value_says_which_part_and_why(
    text: str, message: str | None, span: tuple[int, int]
) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(text)
    if message is not None:
        assert caught.value.message == message
    assert (caught.value.column, caught.value.end_column) == span


def test_a_condition_is_true_or_false_and_nothing_else() -> None:
    assert Expression("$a == 1").holds({}, VARIABLES.__getitem__) is True
    with pytest.raises(ExpressionError, match="a condition is true or false, but this is 1"):
        Expression("$a").holds({}, VARIABLES.__getitem__)


def test_it_tells_the_variables_it_reads_with_their_places() -> None:
    expression = Expression("$a.x + $list.0 > len($a)")
    assert set(expression.variables) == {"a", "list"}
    assert expression.variable_spans == (("a", (0, 2)), ("list", (7, 12)), ("a", (21, 23)))


def test_a_variable_that_raises_is_an_expression_error() -> None:
    def broken(_name: str) -> object:
        raise RuntimeError("the blackboard is on fire")

    with pytest.raises(ExpressionError, match="on fire"):
        Expression("$a").evaluate({}, broken)


class _Hostile:
    def __eq__(self, _other: object) -> bool:
        raise RuntimeError("no comparing")

    def __repr__(self) -> str:
        raise RuntimeError("no showing")

    __hash__ = None  # type: ignore[assignment]


_TOKENS = st.sampled_from(
    ["$a", "$b", "$list", "$where", "$raw", "$gone", "$bad", "result", ".0", ".x", ".pose", "[0]",
     "[", "]", "(", ")", "+", "-", "*", "**", "/", "%", "//", "<", "==", "!=", "and", "or", "not",
     "in", "is", "1", "2.5", "1e308", "99999999999", "'t'", '"', "len(", "max(", "abs(", "str(",
     "known(", ",", " ", "true", "lambda", "if", "else", "for", ":", "=", "#", "ä", "\\", "\n",
     "__class__", "{", "}"]
)  # fmt: skip
_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    | st.builds(_Hostile) | st.binary(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=5,
)  # fmt: skip


@settings(deadline=None, max_examples=500)
@given(st.lists(_TOKENS, max_size=12).map(" ".join) | st.text(max_size=30), _VALUES)
def test_reading_and_evaluating_raise_nothing_but_expression_errors(text: str, bad: object) -> None:
    variables = {**VARIABLES, "bad": bad}
    caught = None
    try:
        Expression(text).evaluate({"result": bad}, variables.__getitem__)
    except ExpressionError as error:
        caught = error
    assert caught is None or 0 <= caught.column < caught.end_column <= len(text) + 1
