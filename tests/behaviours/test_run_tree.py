"""What a RunTree leaf sends, and how it reads what comes back."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import pytest

from bt_actions import Outcome, RunTree
from bt_actions.behaviours.run_tree import inputs_text, roots_of


def test_inputs_are_sent_as_json_and_are_not_escaped_for_yaml_to_misread() -> None:
    values = {"a": 2.0, "texts": ("x", "ü😀"), "pose": {"x": [1, 2**63]}, "no": None, "on": True}
    text = inputs_text(values)
    assert json.loads(text) == {**values, "texts": ["x", "ü😀"]}
    assert "ü😀" in text


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"a": [0.0, math.nan]}, "inputs.a[1] is nan"),
        ({"a": {"b": -math.inf}}, "inputs.a.b is -inf"),
        ({"a": 2**64}, "inputs.a does not fit 64 bits"),
        ({"a": {1}}, "inputs.a is a set"),
        ([1], "inputs are a mapping"),
    ],
)
def test_inputs_that_cannot_be_sent_are_named(values: object, said: str) -> None:
    with pytest.raises(ValueError, match=said.replace("[", r"\[")):
        inputs_text(values)


@pytest.mark.parametrize("text", ["{", "[1]", "[" * 100_000])
def test_outputs_of_a_server_that_are_no_mapping_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="the server's outputs are no"):
        roots_of(SimpleNamespace(outputs=text))


def test_a_run_that_is_not_settled_has_not_succeeded_whatever_its_status() -> None:
    leaf = RunTree("Move", "move", save={"at": "outputs.at"})
    result = SimpleNamespace(settled=False, outputs='{"at": 1.0}', error_msg="Go: left")
    assert not leaf.settles(result)
    assert leaf._read_result(result) == "the run left goals whose end is not known: Go: left"


def test_the_reason_of_a_failure_is_the_root_cause_of_the_run_below() -> None:
    leaf = RunTree("Move", "move")
    result = SimpleNamespace(error_msg="Move / Go: ABORTED\n  move.yaml:8:7")
    assert leaf.explain(Outcome.ABORTED, result) == "Move / Go: ABORTED"
    assert "~/rejections" in leaf.explain(Outcome.REJECTED, None)
