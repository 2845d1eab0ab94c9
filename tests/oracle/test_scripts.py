"""Scripts of BehaviorTree.CPP, said in our words, have the values that they had there."""

from __future__ import annotations

from typing import Any

import pytest

from bt_actions.importing.scripts import ScriptError, Sorts, condition, say, statements
from tests.support.oracle import scripts
from tests.support.oracle.comparing import listed

KNOWN = listed(scripts.DIFFERENCES)


def surprises(cases: list[dict[str, Any]]) -> list[str]:
    found = []
    for case in cases:
        told = scripts.difference(case)
        if bool(told) != (case["id"] in KNOWN):
            found.append(told or f"{case['id']} agrees: take it off the list")
    return found


def test_a_tenth_of_the_scripts_agree_or_are_listed() -> None:
    assert surprises(list(scripts.read())[::10]) == []


@pytest.mark.slow
def test_all_scripts_agree_or_are_listed() -> None:
    cases = list(scripts.read())
    assert len(cases) == 2000
    assert surprises(cases) == []
    assert KNOWN.keys() <= {case["id"] for case in cases}


@pytest.mark.parametrize(
    ("code", "ours"),
    [
        ("held && !door_open", "$held and not $door_open"),
        ("a || b && c", "($a or $b) and $c"),
        ("n + 1 > 3 && name == 'x'", "$n + 1 > 3 and $name == 'x'"),
        ("(a == 1) ? 'one' : b ? 'two' : 'more'", "'one' if $a == 1 else 'two' if $b else 'more'"),
        ("-(a + 2) * 3", "-($a + 2) * 3"),
        ("name .. '_1'", "str($name) + '_1'"),
        ("!(a < b)", "not $a < $b"),
        ("@shared == 1.", "$@shared == 1.0"),
        ("!(n - 1)", "not $n - 1 != 0"),
        ("(a == b) + 1 == 2", "(1 if $a == $b else 0) + 1 == 2"),
    ],
)
def test_a_script_reads_as_an_expression_of_ours(code: str, ours: str) -> None:
    sorts = Sorts()
    asked = condition(code)
    sorts.add_condition(asked)
    assert say(asked, sorts.__getitem__, str).text == ours


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("a b", "'b' has no place there in a script"),
        ("a +", "a value is missing in a script"),
        ("(a", "a ')' is missing in a script"),
        ("a ? b", "a ':' is missing behind a '?' in a script"),
        ("3 = 4", "'=' in a script stands behind no name"),
        ("a = 'b", '" \'b" in a script cannot be read'),
        ("(" * 30 + "a" + ")" * 30, "a script is nested too deep"),
        ("!!a", "a value is missing in a script"),
        ("a" + " + a" * 5000, "a script has a statement of more than 200 words"),
    ],
)
def test_what_is_no_script_is_told(code: str, said: str) -> None:
    with pytest.raises(ScriptError) as caught:
        statements(code)
    assert str(caught.value) == said
