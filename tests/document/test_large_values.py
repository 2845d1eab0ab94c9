"""Values of millions of numbers: within a tick nothing looks at them one by one."""

from __future__ import annotations

import array
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sensor_msgs.msg import Image
from std_msgs.msg import Float64MultiArray
from test_msgs.action import Fibonacci

from bt_actions.document import tree_outputs
from bt_actions.document.load import LOADED
from bt_actions.messages.conversion import MessageError, fill, fill_value
from bt_actions.messages.fields import Listing, Scalar
from tests.document.conftest import tick

Load = Callable[..., Behaviour]
MANY = array.array("i", [7]) * 4_000_000


@contextmanager
def at_once() -> Iterator[None]:
    """One loop of Python's over the numbers takes two seconds and more."""
    started = time.thread_time()
    yield
    assert time.thread_time() - started < 1.0


TREE = """
tree: t
inputs: {many: {type: "int32[]", default: []}}
outputs: {same: "int32[]"}
root:
  sequence: S
  children:
    - check: len($many) > 1000 and $many[3999999] == 7
    - set: {same: $many, rest: {all: $many}}
    - check: len($rest.all) == len($same) and max($same) < 8
    - subtree: other
      with: {given: $same}
"""
OTHER = "tree: other\ninputs: {given: 'int32[]'}\nroot: {check: len($given) > 3}"
GET = """
tree: t
outputs: {first: int32, many: "int32[]"}
root:
  action: Get
  type: test_msgs/action/Fibonacci
  server: get
  expect: len(result.sequence) > 1000
  save: {first: "result.sequence[0]", many: result.sequence}
"""


@pytest.mark.ros
def test_a_large_result_is_expected_and_saved_as_it_is(load: Load) -> None:
    leaf: Any = load(GET)
    result = Fibonacci.Result(sequence=MANY)
    with at_once():
        assert leaf.expect(result)
        saved = [function(result) for function in leaf.save.values()]
    assert saved == [7, MANY]


def test_a_large_variable_is_read_set_and_handed_on_as_it_is(load: Load) -> None:
    root = load(TREE, other=OTHER)
    getattr(root, LOADED).scope.write("many", MANY)
    with at_once():
        status = tick(root)
    assert status is Status.SUCCESS, root.tip().feedback_message
    same = tree_outputs(root)["same"]
    assert isinstance(same, list)
    assert len(same) == 4_000_000


@pytest.mark.parametrize("given", [MANY, MANY.tolist()], ids=["an array", "a list"])
def test_a_message_takes_many_numbers_at_once(given: Any) -> None:
    with at_once():
        assert fill(Fibonacci.Result, {"sequence": given}).sequence == MANY
    with at_once():
        assert len(fill(Float64MultiArray, {"data": given}).data) == 4_000_000
    with at_once():
        assert len(fill(Image, {"data": bytes(1_000_000)}).data) == 1_000_000


@pytest.mark.parametrize(
    ("kind", "given", "wrong"),
    [
        ("int8", array.array("i", [1, 200]), "1: 200 does not fit an int8: -128 to 127"),
        ("int32", array.array("d", [1.5]), "0: a whole number (int32) is needed, not 1.5"),
        ("int32", [1, True], "1: a whole number (int32) is needed, not true"),
        ("float32", [0.5, 1e300], "1: 1e+300 does not fit a float32"),
        ("float64", [1, 10**99 * 10**300], f"1: 1{'0' * 38}… does not fit a float64"),
        ("bool", [True, 1], "1: true or false is needed, not 1"),
    ],
)
def test_one_number_among_many_that_does_not_fit_is_told(kind: str, given: Any, wrong: str) -> None:
    with pytest.raises(MessageError) as raised:
        fill_value(Listing(Scalar(kind)), given)
    assert str(raised.value) == wrong


@pytest.mark.parametrize("text", ["$(many)", "it is $(image)"])
def test_a_large_value_is_no_text(load: Load, text: str) -> None:
    root = load(
        f"""
        tree: t
        inputs: {{many: "int32[]", image: sensor_msgs/msg/Image}}
        outputs: {{text: string}}
        root:
          sequence: S
          children: [{{log: {text}}}, {{set: {{text: {text}}}}}]
        """,
        {"many": [1], "image": {"data": [1]}},
    )
    assert tick(root) is Status.SUCCESS
    scope = getattr(root, LOADED).scope
    scope.write("many", MANY)
    scope.write("image", Image(data=array.array("B", bytes(4_000_000))))
    with at_once():
        assert tick(root) is Status.FAILURE
    log, values = root.children
    assert log.status is Status.SUCCESS
    assert log.feedback_message == text.partition("$")[0] + "…"
    assert values.feedback_message == "the text would be longer than 10,000 characters"
