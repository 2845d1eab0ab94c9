"""The inputs of a goal, as strangers write them."""

from __future__ import annotations

import pytest

from bt_actions.serving.requests import MAX_BYTES, GoalRefused, inputs_of


@pytest.mark.parametrize("text", ["", "  \n", "{}"])
def test_no_inputs_are_the_defaults(text: str) -> None:
    assert inputs_of(text) == {}


@pytest.mark.parametrize("text", ['{"a": 1.5, "b": [1, 2]}', "a: 1.5\nb: [1, 2]"])
def test_inputs_may_be_yaml_or_json(text: str) -> None:
    assert inputs_of(text) == {"a": 1.5, "b": [1, 2]}


@pytest.mark.parametrize("text", ["$other", "@secrets.yaml", "= 1 + 1", "$(x)"])
def test_nothing_in_them_is_computed_and_no_file_is_read(text: str) -> None:
    assert inputs_of(f"a: '{text}'") == {"a": text}


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("a: [1", "BT102", "did not find expected"),
        ("[1, 2]", "INPUTS", "inputs are a mapping"),
        ("just words", "INPUTS", "inputs are a mapping"),
        ("a: 1\na: 2", "BT104", "'a'"),
        ("a: 1e999", "INPUTS", "does not fit a float64"),
        ("a: " + "[" * 10_000, "BT105", ""),
        ("a: \x00", "BT101", "U+0000"),
        ("a: \ud800", "BT101", "no UTF-8"),
        ("a: " + "x" * MAX_BYTES, "INPUTS", "are more than 262,144"),
        ("x: &x [1,1,1,1,1,1,1,1]\n" + "".join(
            f"x{n}: &x{n} [" + ",".join([f"*x{n - 1 or ''}"] * 8) + "]\n" for n in range(1, 9)
        ), "BT105", ""),
    ],
    ids=["broken", "list", "text", "twice", "huge", "deep", "nul", "surrogate", "large", "bomb"],
)  # fmt: skip
def test_what_is_no_mapping_within_bounds_is_refused(text: str, code: str, message: str) -> None:
    with pytest.raises(GoalRefused) as raised:
        inputs_of(text)
    assert message in raised.value.finding.message
    assert raised.value.finding.code == code
