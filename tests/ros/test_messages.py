"""Messages from plain data and back: the rules, as sentences."""

from __future__ import annotations

import math
from typing import Any

import pytest
import test_msgs.msg as msg
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Pose, PoseStamped, PoseWithCovariance, Quaternion
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import BatteryState
from test_msgs.action import Fibonacci, NestedMessage

from bt_actions.messages import fields
from bt_actions.messages.conversion import MessageError, examine, fill, to_plain
from bt_actions.messages.interfaces import UnknownInterface, called, interface


def test_fields_that_are_not_named_keep_their_defaults() -> None:
    assert fill(msg.Defaults, {"int8_value": 3}).int8_value == 3
    assert fill(msg.Defaults, {}).uint8_value == msg.Defaults().uint8_value


def test_nested_messages_are_filled_from_nested_mappings() -> None:
    pose = fill(Pose, {"position": {"x": 1, "z": 2.5}, "orientation": {"w": 1}})
    assert (pose.position.x, pose.position.z, pose.orientation.w) == (1.0, 2.5, 1.0)


def test_a_message_of_the_type_itself_is_taken_as_it_is() -> None:
    point = Point(x=1.0)
    assert fill(Point, point) is point
    assert fill(Pose, {"position": point}).position == point


@pytest.mark.parametrize(
    ("cls", "data", "text"),
    [
        (Pose, {"positon": {}}, "positon: Pose has no field 'positon'; did you mean 'position'?"),
        (Pose, {"zzz": 1}, "zzz: Pose has no field 'zzz'; it has position, orientation"),
        (Pose, {"position": {"x": "a"}}, "position.x: a number (float64) is needed, not 'a'"),
        (Pose, {"position": 3}, "position: the fields of a Point are needed, not 3"),
        (Pose, {"position": Quaternion()},
         "position: the fields of a Point are needed, not a Quaternion"),
        (Pose, [1], "the fields of a Pose are needed, not a list"),
        (Point, {"x": True}, "x: a number (float64) is needed, not true"),
        (Point, {"x": None}, "x: a number (float64) is needed, not nothing"),
        (msg.BasicTypes, {"int32_value": 2.5}, ("int32_value: a whole number (int32) is needed,"
         " not 2.5")),
        (msg.BasicTypes, {"uint8_value": 256}, "uint8_value: 256 does not fit a uint8: 0 to 255"),
        (msg.BasicTypes, {"int8_value": -129}, ("int8_value: -129 does not fit an int8: -128 to"
         " 127")),
        (msg.BasicTypes, {"float32_value": 1e39}, "float32_value: 1e+39 does not fit a float32"),
        (msg.BasicTypes, {"float64_value": 10**400}, None),
        (msg.BasicTypes, {"bool_value": 1}, "bool_value: true or false is needed, not 1"),
        (msg.Strings, {"string_value": 5}, "string_value: a text is needed, not 5"),
        (msg.Strings, {"string_value": "a\0b"}, None),
        (msg.Strings, {"bounded_string_value": "x" * 23},
         "bounded_string_value: at most 22 characters fit, not 23"),
        (msg.BoundedSequences, {"int32_values": [1, 2, 3, 4]},
         "int32_values: at most 3 items fit, not 4"),
        (msg.Arrays, {"int32_values": [1]}, "int32_values: exactly 3 items are needed, not 1"),
        (msg.UnboundedSequences, {"int32_values": [1, 2.5]},
         "int32_values.1: a whole number (int32) is needed, not 2.5"),
        (msg.UnboundedSequences, {"int32_values": "123"},
         "int32_values: a list of int32 is needed, not '123'"),
        (Fibonacci.Goal, {"ordr": 5}, ("ordr: Fibonacci.Goal has no field 'ordr'; did you mean"
         " 'order'?")),
        (msg.Empty, {"x": 1}, "x: Empty has no field 'x': it has no fields"),
        (BatteryState, {"power_supply_status": "POWER_SUPPLY_STATUS_FUL"},
         ("power_supply_status: BatteryState has no constant 'POWER_SUPPLY_STATUS_FUL'; did you"
         " mean 'POWER_SUPPLY_STATUS_FULL'?")),
        (Quaternion, {"yaw": "90 degrees"},
         "unknown unit 'degrees' in '90 degrees': one of rad, deg, °"),
        (Quaternion, {"yaw": 1, "w": 1},
         "roll, pitch and yaw stand alone: 'w' cannot be beside them"),
        (Time, "yesterday", "a time is 'now', seconds, or {sec, nanosec}, not 'yesterday'"),
        (Duration, "5 parsecs", None),
        (Duration, 1e12, "1000000000000.0 seconds do not fit a time"),
    ],
)  # fmt: skip
def test_what_does_not_fit_says_where_and_why(cls: type, data: object, text: str | None) -> None:
    with pytest.raises(MessageError) as caught:
        fill(cls, data)
    if text is not None:
        assert str(caught.value) == text


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(MessageError) as caught:
        fill(Pose, {"positon": 1, "orientation": {"x": "a", "y": [], "z": 1}})
    assert [problem.path for problem in caught.value.problems] == [
        ("positon",), ("orientation", "x"), ("orientation", "y")
    ]  # fmt: skip
    assert caught.value.problems[0].at_key


def test_a_float_comes_from_a_whole_number() -> None:
    value = fill(Point, {"x": 3}).x
    assert (value, type(value)) == (3.0, float)


def test_times_and_durations_are_written_as_people_say_them() -> None:
    stamp = fill(PoseStamped, {"header": {"stamp": "now"}}, now=lambda: 12_000_000_034)
    assert stamp.header.stamp == Time(sec=12, nanosec=34)
    assert fill(Duration, "500 ms") == Duration(sec=0, nanosec=500_000_000)
    assert fill(Duration, 1.5) == Duration(sec=1, nanosec=500_000_000)
    assert fill(Duration, {"sec": 2}) == Duration(sec=2)
    assert fill(Duration, "-1 s") == fill(Duration, -1) == Duration(sec=-1)
    assert fill(Duration, "-500 ms") == Duration(sec=-1, nanosec=500_000_000)
    assert fill(Time, -0.5) == Time(sec=-1, nanosec=500_000_000)


def test_a_quaternion_is_written_as_angles() -> None:
    q = fill(Quaternion, {"yaw": "90 deg"})
    assert (q.x, q.y) == (0.0, 0.0)
    assert math.isclose(q.z, math.sqrt(0.5))
    assert math.isclose(q.w, math.sqrt(0.5))
    r = fill(Quaternion, {"roll": math.pi})
    assert math.isclose(r.x, 1.0)


def test_a_constant_stands_for_its_value() -> None:
    full = BatteryState.POWER_SUPPLY_STATUS_FULL
    for name in (
        "POWER_SUPPLY_STATUS_FULL",
        "BatteryState.POWER_SUPPLY_STATUS_FULL",
        "sensor_msgs/msg/BatteryState.POWER_SUPPLY_STATUS_FULL",
    ):
        assert fill(BatteryState, {"power_supply_status": name}).power_supply_status == full


def test_a_constant_of_another_part_of_the_action_is_found() -> None:
    robot = pytest.importorskip("robot_control_interfaces.action")
    moving = robot.MoveRobot.Feedback.STATUS_MOVING
    for name in (
        "STATUS_MOVING",
        "Feedback.STATUS_MOVING",
        "MoveRobot.Feedback.STATUS_MOVING",
        "robot_control_interfaces/action/MoveRobot.Feedback.STATUS_MOVING",
    ):
        assert fill(robot.MoveRobot.Feedback, {"status": name}).status == moving
    assert fill(robot.MoveRobot.Result, {"status": "Feedback.STATUS_MOVING"}).status == moving


def test_arrays_of_messages_and_bytes_are_filled() -> None:
    arrays = fill(
        msg.UnboundedSequences,
        {"basic_types_values": [{"int8_value": 1}, msg.BasicTypes()], "byte_values": [1, 255]},
    )
    assert arrays.basic_types_values[0].int8_value == 1
    assert arrays.byte_values == [b"\x01", b"\xff"], "as they are sent"
    assert to_plain(arrays)["byte_values"] == [1, 255]
    covariance = fill(PoseWithCovariance, {"covariance": [0.5] * 36})
    assert to_plain(covariance)["covariance"] == [0.5] * 36


def test_examining_asks_about_each_value_with_the_type_it_must_have() -> None:
    asked: list[tuple[object, str]] = []

    def hole(value: object, kind: fields.FieldType, path: tuple[str | int, ...]) -> bool:
        asked.append((".".join(map(str, path)), str(kind)))
        return value == "$here"

    data = {"position": {"x": "$here", "y": 2}, "orientation": "$here"}
    assert examine(fields.Message(Pose), data, hole) == []
    assert asked == [
        ("position.x", "float64"), ("position.y", "float64"), ("orientation", "Quaternion"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("test_msgs/action/Fibonaci", "action",
         "package 'test_msgs' has no action 'Fibonaci'; did you mean 'Fibonacci'?"),
        ("test_msgs/action/Foo", "action",
         "package 'test_msgs' has no action 'Foo'; it has Fibonacci, NestedMessage"),
        ("tes_msgs/action/Fibonacci", "action",
         "package 'tes_msgs' is not installed here, or has no actions; did you mean 'test_msgs'?"),
        ("os/action/Path", "action",
         ("package 'os' is not installed here, or has no actions: install it, or source the"
         " workspace it is built in")),
        ("Fibonacci", "action", "'Fibonacci' is no type name: it is written package/action/Name"),
        ("test_msgs/msg/Empty", "action", "'test_msgs/msg/Empty' names no action, but one of msg/"),
        ("../x/action/A", "action",
         "'../x/action/A' is no type name: it is written package/action/Name"),
    ],
)  # fmt: skip
def test_an_unknown_interface_names_the_package_and_what_it_has(
    name: str, kind: Any, text: str
) -> None:
    with pytest.raises(UnknownInterface) as caught:
        interface(name, kind)
    assert str(caught.value) == text


def test_an_action_is_found_by_its_short_name() -> None:
    for name in ("Fibonacci", "test_msgs/Fibonacci", "test_msgs/action/Fibonacci"):
        assert called(name, "action") is Fibonacci
    with pytest.raises(UnknownInterface, match="did you mean 'NestedMessage'"):
        called("NestedMesage", "action")


_ROUND_TRIP = [
    msg.Arrays, msg.BasicTypes, msg.BoundedSequences, msg.BoundedPlainSequences, msg.Builtins,
    msg.Constants, msg.Defaults, msg.Empty, msg.Nested, msg.Strings,
    msg.UnboundedSequences, msg.WStrings, Fibonacci.Result, NestedMessage.Feedback, PoseStamped,
    PoseWithCovariance, BatteryState,
]  # fmt: skip


def _data(kind: fields.FieldType) -> st.SearchStrategy[Any]:
    if isinstance(kind, fields.Message):
        return st.fixed_dictionaries(
            {}, optional={name: _data(sub) for name, sub in fields.describe(kind.cls).items()}
        )
    if isinstance(kind, fields.Listing):
        low = kind.size or 0
        high = kind.size if kind.size is not None else min(kind.limit or 3, 3)
        return st.lists(_data(kind.item), min_size=low, max_size=high)
    if kind.name == "bool":
        return st.booleans()
    if kind.name in fields.FLOATS:
        # The greatest float32 is beyond what rosidl's own check lets through.
        return st.floats(-(2.0**120), 2.0**120, width=32) | st.integers(-100, 100)
    if kind.name in fields.INTEGERS:
        return st.integers(*fields.INTEGERS[kind.name])
    letters = st.characters(exclude_categories=["Cs"], exclude_characters="\0")
    return st.text(letters, max_size=min(kind.limit or 5, 5))


@pytest.mark.parametrize("cls", _ROUND_TRIP, ids=lambda cls: cls.__name__)
def test_what_was_filled_comes_back_the_same(cls: type) -> None:
    @settings(deadline=None, max_examples=25)
    @given(_data(fields.Message(cls)))
    def round_trip(data: object) -> None:
        message = fill(cls, data)
        plain = to_plain(message)
        assert repr(to_plain(fill(cls, plain))) == repr(plain)
        for name, value in data.items():  # type: ignore[attr-defined]
            if not isinstance(value, (dict, list, float)):
                assert plain[name] == value

    round_trip()


def test_a_message_of_nested_messages_comes_back_the_same() -> None:
    plain = to_plain(msg.MultiNested())
    assert to_plain(fill(msg.MultiNested, plain)) == plain


_ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["position", "x", "orientation", "yaw", "w", "q"]), inner)
    ),
    max_leaves=6,
)


@settings(deadline=None, max_examples=300)
@given(_ANY)
def test_any_data_is_a_message_or_a_message_error(data: object) -> None:
    for cls in (Pose, Time, Duration, Quaternion, msg.Arrays):
        problems = examine(fields.Message(cls), data)
        if problems:
            with pytest.raises(MessageError):
                fill(cls, data)
        else:
            assert isinstance(fill(cls, data), cls)
