"""The rules of short texts of values, as sentences."""

from __future__ import annotations

import array
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.utilities.shorten import MESSAGE, fit, given_fields, shorten


class Point:
    """A message, as far as anybody here can see."""

    def __init__(self) -> None:
        self.x, self.on, self.data = 1.5, True, array.array("B", [1, 2])

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        return {"x": "double", "on": "boolean", "data": "sequence<uint8>"}


class Rude:
    def __repr__(self) -> str:
        raise RuntimeError("no")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1, "1"),
        (True, "true"),
        (None, "nothing"),
        ("it's", '"it\'s"'),
        ([1, 2.5, "a"], "[1, 2.5, 'a']"),
        ((), "[]"),
        ({"a": {"b": [1]}, 2: None}, "{a: {b: [1]}, 2: nothing}"),
        (Point(), "{x: 1.5, on: true, data: [1, 2]}"),
        (b"\x07", "7"),
        (b"\x07\x08", "[7, 8]"),
        (array.array("i", [7]) * 4_000_000, "[7, 7, 7, … 4000000 items]"),
        (np.zeros(3), "[0.0, 0.0, 0.0]"),
        (np.float64(2.0), "2.0"),
        (np.float32(0.7), "0.7"),
        (np.array([0.7, 16777217.0], np.float32), "[0.7, 16777216.0]"),
        (array.array("f", [0.7, -1e-30, math.inf]), "[0.7, -1e-30, inf]"),
        ([[7] * 100] * 2, "[[7, 7, 7, … 100 items], [7, 7, 7, … 100 items]]"),
        ([Rude()], "[<Rude>]"),
        (SimpleNamespace(a=1), "namespace(a=1)"),
    ],
)
def test_a_value_is_shown_as_it_is_written_and_a_long_list_by_its_length(
    value: object, text: str
) -> None:
    assert shorten(value) == text


def test_a_long_message_loses_its_middle_alone() -> None:
    assert fit("as it is") == "as it is"
    assert fit("a" * 50 + "b" * 50, 30) == f"{'a' * 17} … {'b' * 10}"
    assert len(fit("x" * 1000)) == MESSAGE


def test_the_fields_that_a_message_gives_are_those_that_a_new_one_has_not() -> None:
    message = Point()
    assert given_fields(message) == {}
    message.on, message.data = False, array.array("B", [7]) * 4_000_000
    assert shorten(given_fields(message)) == "{on: false, data: [7, 7, 7, … 4000000 items]}"
    assert given_fields("no message") == {}


class Grid:
    """A message with a field of a fixed length."""

    def __init__(self) -> None:
        self.cells, self.at = np.zeros(3), Point()

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        return {"cells": "double[3]", "at": "Point"}


def test_a_field_with_others_in_it_is_given_where_one_of_them_is() -> None:
    grid = Grid()
    assert given_fields(grid) == {}
    grid.at.x = 7.0
    assert shorten(given_fields(grid)) == "{at: {x: 7.0}}"
    grid.cells[1] = 1.0
    assert shorten(given_fields(grid)) == "{cells: [0.0, 1.0, 0.0], at: {x: 7.0}}"


def test_what_is_longer_than_the_limit_ends_with_an_ellipsis() -> None:
    assert shorten("a" * 1000, 10) == "'aaaaaaaa…"
    assert shorten({"a": "b" * 10, "c": "d" * 10}, 25) == "{a: 'bbbbbbbbbb', c: 'dd…"
    assert shorten([1, 2, 3], 9) == "[1, 2, 3]"


VALUES = st.recursive(
    st.integers() | st.text() | st.binary() | st.floats(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(VALUES, st.integers(1, 80))
def test_no_text_is_longer_than_the_limit(value: object, limit: int) -> None:
    assert len(shorten(value, limit)) <= limit
