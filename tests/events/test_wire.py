"""Events as lines: what is read back equals what was written, and a hostile line is refused."""

from __future__ import annotations

import collections.abc
import dataclasses
import enum
import json
import types
import typing
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bt_actions.events import Event, Moment, RunEnded, WireError, from_line, to_line, wire
from bt_actions.events.kinds import (
    AttemptEnded,
    ClockJumped,
    EventsLost,
    Node,
    Paused,
    RunBegan,
    VariableWritten,
)
from bt_actions.events.snapshot import Cut, Value
from bt_actions.goals.policy import Outcome

AT = Moment(1, 2.0, 3.0, 4.0)
PATIENT: Any = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
"""For a busy machine."""
TEXTS = st.text(st.characters(exclude_categories=()), max_size=8)  # lone surrogates, too
KEYS = TEXTS | st.sampled_from(["$", "$int", "$float", "$bytes", "$cut", "$map", "$$"])
NUMBERS = st.sampled_from([2**53 - 1, 2**53, 2**53 + 1, 2**63 - 1, -(2**63), 2**64 - 1, 2**200])
SCALARS = st.none() | st.booleans() | st.integers() | NUMBERS | st.floats() | TEXTS | st.binary()


def _holding(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    held = st.lists(inner, max_size=3).map(tuple) | st.dictionaries(KEYS, inner, max_size=3)
    cut = st.builds(Cut, held | TEXTS | st.binary(), st.integers(0, 2**63 - 1))
    return held | cut


VALUES: st.SearchStrategy[Any] = st.recursive(SCALARS, _holding, max_leaves=8)


def of(hint: Any) -> st.SearchStrategy[Any]:
    """All that a field of an event may hold."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is Value:
        return VALUES
    if origin in (typing.Union, types.UnionType):
        return st.one_of([st.none() if each is type(None) else of(each) for each in inner])
    if origin is collections.abc.Mapping:
        return st.dictionaries(KEYS, of(inner[1]), max_size=3)
    if origin is tuple:
        return st.lists(of(inner[0]), max_size=3).map(tuple)
    if issubclass(hint, enum.Enum):
        return st.sampled_from(hint)
    if hint is Moment:
        clock = st.floats(-1e10, 1e10)
        return st.builds(Moment, st.integers(0, 2**40), clock, clock, clock)
    if dataclasses.is_dataclass(hint):
        fields = typing.get_type_hints(hint)
        return st.builds(hint, **{name: of(each) for name, each in fields.items()})
    return {
        bool: st.booleans(),
        int: st.integers(-(2**63), 2**63 - 1),
        float: st.floats(),
        str: TEXTS,
    }[hint]


@pytest.mark.parametrize("kind", wire.KINDS.values(), ids=list(wire.KINDS))
@settings(max_examples=60, **PATIENT)
@given(data=st.data())
def test_an_event_that_was_read_equals_the_one_that_was_written(
    kind: type[Event], data: st.DataObject
) -> None:
    """By what `repr` shows: it tells -0.0 from 0.0 and 1 from True, and finds NaN equal to NaN."""
    event = data.draw(of(kind))
    line = to_line(event)
    assert line.isascii()
    assert "\n" not in line
    assert repr(from_line(line)) == repr(event)
    assert repr(from_line(line.encode())) == repr(event)


def test_each_kind_of_event_has_its_name_on_the_wire() -> None:
    kinds = {kind.__name__ for kind in Event.__subclasses__()}
    assert set(wire.KINDS) == kinds
    assert json.loads(to_line(Paused(AT, True))) == {
        "kind": "Paused",
        "at": [1, 2.0, 3.0, 4.0],
        "paused": True,
    }


def test_what_json_cannot_say_stands_behind_a_dollar_sign() -> None:
    value = {"nan": float("nan"), "large": 2**63, "raw": b"\x00\xff", "cut": Cut((1,), 9), "n": 1}
    written = json.loads(to_line(VariableWritten(AT, "x", value, None)))["value"]
    assert written == {
        "nan": {"$float": "nan"},
        "large": {"$int": "9223372036854775808"},
        "raw": {"$bytes": "AP8="},
        "cut": {"$cut": [[1], 9]},
        "n": 1,
    }
    tricky = VariableWritten(AT, "x", {"$int": "5"}, None)
    assert json.loads(to_line(tricky))["value"] == {"$map": [["$int", "5"]]}


# Hostile lines


@pytest.mark.parametrize("clock", [1, 2, 3])
@pytest.mark.parametrize("seconds", [float("nan"), float("inf"), -1e300])
def test_a_moment_that_no_clock_shows_is_none(clock: int, seconds: float) -> None:
    at = list(AT)
    at[clock] = seconds
    with pytest.raises(WireError, match="no clock"):
        from_line(to_line(Paused(Moment(*at), True)))


NODES = (Node(1, None, "root", "sequence"), Node(2, 1, "Move", "move", settings={"attempts": 3}))
LINE = to_line(RunBegan(AT, "0" * 32, "t", NODES, {"x": (1, 2.5)}, {"t.yaml": "tree: t"}, {}))
JUDGED = to_line(AttemptEnded(AT, 1, "ab", 1, Outcome.ABORTED, "a fault", seen={"a": b"\x01"}))


@pytest.mark.parametrize("line", [LINE, JUDGED])
def test_a_line_that_is_cut_off_anywhere_is_no_event(line: str) -> None:
    for end in range(len(line)):
        with pytest.raises(WireError):
            from_line(line[:end])


def variable(value: str) -> str:
    """The line of a variable that has this value."""
    return f'{{"kind": "VariableWritten", "at": [1, 2.0, 3.0, 4.0], "name": "x", "value": {value}, "node": null}}'  # noqa: E501


DEEP = 100_000
OVER = '{"kind": "RunEnded", "at": [1, 2.0, 3.0, 4.0], "exit_code": %s}'
WRONG = {
    "nothing": "",
    "no object": "[]",
    "a number": "5",
    "no utf-8": b"\xff\xfe\x00{",
    "no kind": "{}",
    "a kind that is none": '{"kind": "Nonsense", "at": [1, 2.0, 3.0, 4.0]}',
    "the kind of all": '{"kind": "Event", "at": [1, 2.0, 3.0, 4.0]}',
    "a kind that is a list": '{"kind": []}',
    "no moment": '{"kind": "Paused", "paused": true}',
    "a moment of three": '{"kind": "Paused", "at": [1, 2.0, 3.0], "paused": true}',
    "a moment that is a number": '{"kind": "Paused", "at": 1, "paused": true}',
    "a number for a truth": '{"kind": "Paused", "at": [1, 2.0, 3.0, 4.0], "paused": 1}',
    "a truth for a number": OVER % "true",
    "a text for a number": OVER % '"1"',
    "a field too many": '{"kind": "Paused", "at": [1, 2.0, 3.0, 4.0], "paused": true, "x": 1}',
    "an outcome that is none": JUDGED.replace("ABORTED", "NONSENSE"),
    "lists without an end": variable("[" * DEEP),
    "lists in lists": variable("[" * DEEP + "]" * DEEP),
    "objects in objects": variable('{"a":' * DEEP + "1" + "}" * DEEP),
    "cuts in cuts": variable('{"$cut":[' * 900 + "[]" + ",1]}" * 900),
    "an integer that is none": variable('{"$int": "x"}'),
    "an integer that is infinite": variable('{"$int": 1e400}'),
    "an integer of many digits": variable('{"$int": "%s"}' % ("9" * 10_000)),
    "a float that is none": variable('{"$float": {}}'),
    "a float of many digits": variable('{"$float": 1%s}' % ("0" * 400)),
    "bytes that are none": variable('{"$bytes": "é"}'),
    "a cut that is none": variable('{"$cut": 5}'),
    "a cut without an end": variable('{"$cut": [[], 1e400]}'),
    "a number of 65 bits": OVER % '{"$int": "9223372036854775808"}',
    "a number of many digits": OVER % ("9" * 4300),
    "a cut of many digits": variable('{"$cut": [[], %s]}' % ("9" * 4300)),
    "a map that is none": variable('{"$map": [1]}'),
    "inputs that are a number": LINE.replace('"inputs":{"x":[1,2.5]}', '"inputs":5'),
    "settings that are a list": LINE.replace('"settings":{"attempts":3}', '"settings":[]'),
    "sources that are numbers": LINE.replace('"tree: t"', "5"),
    "nodes that are a text": LINE.replace('"nodes":[', '"nodes":"x","x":['),
}


@pytest.mark.parametrize("line", WRONG.values(), ids=list(WRONG))
def test_a_hostile_line_is_a_wire_error_and_nothing_else(line: str | bytes) -> None:
    assert line not in (LINE, JUDGED)
    with pytest.raises(WireError):
        from_line(line)


JSON: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=300, **PATIENT)
@given(data=st.data())
def test_whatever_stands_in_a_field_it_is_an_event_or_a_wire_error(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(list(wire.KINDS.values())))
    told = json.loads(to_line(data.draw(of(kind))))
    name = data.draw(st.sampled_from(list(told)))
    told[name] = data.draw(JSON)
    try:
        event = from_line(json.dumps(told))
    except WireError:
        return
    assert from_line(to_line(event)) is not None, "what was read can be written"


def test_numbers_and_texts_of_an_event_are_those_of_its_kind() -> None:
    for event in (ClockJumped(AT, "wall", 5.0), EventsLost(AT, 3), RunEnded(AT, 0)):
        assert from_line(to_line(event)) == event
