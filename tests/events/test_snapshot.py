"""Snapshots: bounded in fields, size and time, and not changed by what happens to the value."""

from __future__ import annotations

import array
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from bt_actions.events import Moment, VariableWritten, from_line, to_line
from bt_actions.events.snapshot import DEEP, FIELDS, SIZE, Cut, Value, snapshot
from bt_actions.goals.policy import Outcome

BOUND = 0.1
"""Seconds of this thread; to look at ten million items takes more, and a snapshot 0.003 s."""


def parts(value: Value) -> Iterator[Value]:
    """Yield all that a snapshot holds, itself included."""
    waiting = [value]
    while waiting:
        yield (each := waiting.pop())
        each = each.head if isinstance(each, Cut) else each
        if isinstance(each, tuple):
            waiting += each
        elif isinstance(each, dict):
            waiting += [*each.keys(), *each.values()]


def size_of(value: Value) -> int:
    return sum(
        len(each.head)
        if isinstance(each, Cut)
        else len(each)
        if isinstance(each, str | bytes)
        else 8
        for each in parts(value)
        if not isinstance(each, tuple | dict)
    )


def taken(value: object) -> Value:
    """The snapshot of a value, which is bounded in time, fields and size, and can be written."""
    began = time.thread_time()
    found = snapshot(value)
    assert time.thread_time() - began < BOUND
    assert sum(1 for _ in parts(found)) <= 3 * FIELDS
    assert size_of(found) <= 2 * SIZE
    event = VariableWritten(Moment(1, 2.0, 3.0, 4.0), "x", found, None)
    assert repr(from_line(to_line(event))) == repr(event)
    return found


@pytest.mark.parametrize(
    "make",
    [
        lambda: [7] * 10_000_000,
        lambda: (7,) * 10_000_000,
        lambda: array.array("d", [7.0]) * 10_000_000,
        lambda: np.full(10_000_000, 7),
        lambda: set(range(10_000_000)),
        lambda: [[7]] * 10_000_000,
    ],
    ids=["list", "tuple", "array", "numpy", "set", "list of lists"],
)
def test_of_ten_million_items_the_first_are_taken_and_the_others_counted(
    make: Callable[[], Any],
) -> None:
    found = taken(make())
    assert isinstance(found, Cut)
    assert 0 < len(found.head) <= FIELDS
    assert len(found.head) + found.more == 10_000_000


def test_of_a_mapping_and_of_texts_the_beginning_is_taken_and_the_rest_counted() -> None:
    found = taken({str(number): number for number in range(100_000)})
    assert isinstance(found, Cut)
    assert len(found.head) + found.more == 100_000
    assert taken("x" * 10_000_000) == Cut("x" * SIZE, 10_000_000 - SIZE)
    assert taken(b"xy" * 5_000_000) == Cut(b"xy" * (SIZE // 2), 10_000_000 - SIZE)


def test_the_bounds_are_those_of_the_whole() -> None:
    texts = taken(["x" * 10_000] * 1000)
    assert isinstance(texts, Cut)
    assert texts.more == 993
    assert isinstance(texts.head[-1], Cut)
    taken([[number] * 100 for number in range(1000)])
    taken({"a": [1] * 900, "b": [2] * 900})


def holds_itself(times: int) -> list[Any]:
    value: list[Any] = []
    value.extend([value] * times)
    return value


def holds_itself_by_name() -> dict[str, Any]:
    value: dict[str, Any] = {}
    value |= {"a": value, "b": value}
    return value


def wide(deep: int) -> list[Any]:
    """Lists of a thousand lists, of which all are one."""
    value: list[Any] = []
    for _ in range(deep):
        value = [value] * 1000
    return value


@pytest.mark.parametrize(
    "value",
    [holds_itself(1), holds_itself(2), holds_itself(1000), holds_itself_by_name(), wide(5)],
    ids=["once", "twice", "often", "by name", "empty lists in lists"],
)
def test_what_holds_itself_ends_somewhere(value: object) -> None:
    found: Any = taken(value)
    depth = 0
    while found := found.head if isinstance(found, Cut) else found:
        found = next(iter(found.values() if isinstance(found, dict) else found))
        depth += 1
    assert depth <= DEEP


def test_a_key_and_a_number_are_bounded_too() -> None:
    taken({"k" * 10_000_000: 1})
    taken(10**1_000_000)
    taken(10**5000)


class Raises(Mapping[str, object]):
    """A mapping of which one method raises."""

    def __init__(self, method: str) -> None:
        self._method = method

    def _check(self, method: str) -> None:
        if method == self._method:
            raise RuntimeError("a bug")

    def __getitem__(self, key: str) -> object:
        self._check("__getitem__")
        return 1

    def __iter__(self) -> Iterator[str]:
        self._check("__iter__")
        return iter(("a",))

    def __len__(self) -> int:
        self._check("__len__")
        return 1


class Endless(Raises):
    """A mapping whose names never end."""

    def __iter__(self) -> Iterator[str]:
        while True:
            yield ""

    def __getitem__(self, key: str) -> object:
        return ()


@pytest.mark.parametrize("method", ["__getitem__", "__iter__", "__len__"])
def test_a_value_whose_methods_raise_is_named_by_its_class(method: str) -> None:
    assert taken([Raises(method), 2]) == ("<Raises>", 2)


def test_a_mapping_that_never_ends_is_cut() -> None:
    taken(Endless(""))


def test_what_is_no_data_is_named_by_its_class() -> None:
    assert taken([object(), Outcome.ABORTED, None]) == ("<object>", "ABORTED", None)
    assert type(taken(Outcome.ABORTED)) is str


def test_numpy_is_plain_data_and_float32_has_its_shortest_digits() -> None:
    assert taken(np.float32(0.7)) == 0.7
    assert taken(np.array([0.7, 0.1], dtype=np.float32)) == (0.7, 0.1)
    assert taken(np.array([[1, 2], [3, 4]])) == ((1, 2), (3, 4))
    assert taken([np.int64(5), np.bool_(True)]) == (5, True)
    assert [type(each) for each in taken([np.int64(5), np.bool_(True)])] == [int, bool]  # type: ignore[union-attr]


def test_a_ros_message_is_its_fields() -> None:
    from geometry_msgs.msg import PoseStamped
    from std_msgs.msg import Float32, Float32MultiArray, UInt8MultiArray

    assert taken(Float32(data=0.7)) == {"data": 0.7}
    assert taken(Float32MultiArray(data=[0.7, 0.1]))["data"] == (0.7, 0.1)  # type: ignore[index]
    pose = PoseStamped()
    pose.header.frame_id = "map"
    found: Any = taken(pose)
    assert found["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "map"}
    assert found["pose"]["orientation"]["w"] == 1.0
    many = taken(UInt8MultiArray(data=bytes(1_000_000)))["data"]  # type: ignore[index]
    assert isinstance(many, Cut)
    assert len(many.head) + many.more == 1_000_000


def test_a_snapshot_does_not_change_with_the_value() -> None:
    from std_msgs.msg import Float32MultiArray

    inner = {"x": [1, 2]}
    raw, numbers, message = bytearray(b"ab"), np.array([1, 2]), Float32MultiArray(data=[1.0])
    value: dict[str, Any] = {"inner": inner, "raw": raw, "numbers": numbers, "message": message}
    found = taken(value)
    before = repr(found)
    inner["x"].append(3)
    inner["y"] = []
    raw[0] = 0
    numbers[0] = 9
    message.data[0] = 9.0
    value.clear()
    assert repr(found) == before
