"""Variables, expressions and constants inside the messages that a tree writes."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.document import check_source, source_of
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from tests.document.conftest import tick

Load = Callable[..., Behaviour]


def said(type_name: str, message: str, inputs: str = "a: float64, u: uint8") -> list[str]:
    """What is found in a tree that publishes a message."""
    text = f"tree: t\ninputs: {{{inputs}}}\nroot:\n  publish: p\n  type: {type_name}\n"
    found = check_source(source_of(f"{text}  message: {message}\n".encode(), "t"))
    return [f"{one.code} {one.message}" for one in found if one.code != "BT308"]


@pytest.mark.parametrize(
    ("type_name", "message"),
    [
        ("std_msgs/msg/Float64MultiArray", "{data: [$a, 1.0]}"),
        ("std_msgs/msg/Int32MultiArray", "{data: [$u]}"),
        ("sensor_msgs/msg/BatteryState", "{cell_voltage: [$a, = $a + 1]}"),
        ("sensor_msgs/msg/Image", "{data: [$u, 0]}"),
        ("geometry_msgs/msg/PoseWithCovariance", f"{{covariance: [{', '.join(['$a'] * 36)}]}}"),
        (
            "trajectory_msgs/msg/JointTrajectory",
            "{points: [{positions: [$a, 0.0], time_from_start: 500 ms}]}",
        ),
    ],
)
def test_a_variable_may_stand_in_an_array_of_numbers(type_name: str, message: str) -> None:
    assert said(type_name, message) == []


@pytest.mark.parametrize(
    "name",
    [
        "MoveRobot.Feedback.STATUS_MOVING",
        "robot_control_interfaces/action/MoveRobot.Feedback.STATUS_MOVING",
        "BatteryState.POWER_SUPPLY_STATUS_FULL",
    ],
)
def test_a_constant_may_be_named_where_any_number_is_needed(name: str) -> None:
    assert said("std_msgs/msg/UInt8", f"{{data: {name}}}") == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("MoveRobot.Feedback.STATUS_MOVIN", "; did you mean 'STATUS_MOVING'?"),
        ("MoveRobt.Feedback.STATUS_MOVING", "no installed package has the action 'MoveRobt'"),
        ("STATUS_MOVING", "has no constant 'STATUS_MOVING'"),
    ],
)
def test_a_constant_that_is_not_there_is_told(name: str, text: str) -> None:
    (found,) = said("std_msgs/msg/UInt8", f"{{data: {name}}}")
    assert text in found


def test_a_variable_with_a_type_takes_a_constant_by_its_name(load: Load) -> None:
    root = load(
        """
        tree: t
        outputs: {status: uint8}
        root:
          sequence: S
          children:
            - set: {status: MoveRobot.Feedback.STATUS_MOVING}
            - check: $status == 1
        """
    )
    assert tick(root) is Status.SUCCESS


@pytest.mark.parametrize("angle", ["$a", "= $a * 2", "90 deg", "$u"])
def test_a_variable_may_be_an_angle_in_radians(angle: str) -> None:
    message = f"{{orientation: {{yaw: {angle}, roll: 10 deg}}}}"
    assert said("geometry_msgs/msg/Pose", message) == []


@pytest.mark.parametrize(
    ("angles", "text"),
    [
        ("{yaw: $s}", "BT204 a float64 is needed, and $s is a string"),
        ("{yaw: $nope}", "BT202 there is no variable $nope"),
        ("{yaw: $a, w: 1}", "BT204 roll, pitch and yaw stand alone: 'w' cannot be beside them"),
        ("{yaw: $a, roll: far}", "BT204 an angle is needed, such as '90 deg', not 'far'"),
    ],
)
def test_a_variable_that_is_no_angle_is_told(angles: str, text: str) -> None:
    inputs = "a: float64, s: string"
    assert said("geometry_msgs/msg/Pose", f"{{orientation: {angles}}}", inputs) == [text]


def test_an_angle_that_a_variable_gives_becomes_a_quaternion(load: Load) -> None:
    root = load(
        """
        tree: t
        inputs: {a: {type: float64, default: 1.0}}
        outputs: {turn: geometry_msgs/msg/Quaternion}
        root:
          sequence: S
          children:
            - set: {turn: {yaw: = $a * 2}}
            - check: $turn.z > 0.84 and $turn.z < 0.85
        """
    )
    assert tick(root) is Status.SUCCESS


def test_a_constant_of_a_message_may_stand_in_an_expression(load: Load) -> None:
    root = load(
        """
        tree: t
        inputs: {status: {type: uint8, default: 1}}
        root:
          sequence: S
          children:
            - check: $status == MoveRobot.Feedback.STATUS_MOVING
            - check: $status in [MoveRobot.Result.STATUS_CANCELED, 7]
        """
    )
    assert tick(root) is Status.SUCCESS


def test_without_types_no_constant_is_looked_up() -> None:
    text = b"tree: t\nroot: {check: 1 == NoSuch.Result.STATUS}\n"
    assert check_source(source_of(text, "t"), types=False) == []
    assert [one.code for one in check_source(source_of(text, "t"))] == ["BT203"]


def test_a_constant_that_is_not_there_has_no_value() -> None:
    def none_there(name: str) -> object:
        raise ValueError(f"no {name}")

    expression = Expression("A.B == 1", roots=(), constants=none_there)
    assert expression.form.constants == ["A.B"]
    with pytest.raises(ExpressionError, match=r"no A\.B"):
        expression.evaluate({}, lambda name: name)


@pytest.mark.parametrize(
    "condition",
    ["$s.level == 2", "$s.level >= DiagnosticStatus.ERROR", "$b + 1 == 3", "1 in $l", "$l.0 == 1"],
)
def test_a_byte_is_a_number(load: Load, condition: str) -> None:
    root = load(
        f"""
        tree: t
        inputs:
          s: {{type: diagnostic_msgs/msg/DiagnosticStatus, default: {{level: ERROR}}}}
          b: {{type: byte, default: 2}}
          l: {{type: "byte[]", default: [1, 2]}}
        outputs: {{n: int64, m: diagnostic_msgs/msg/DiagnosticStatus}}
        root:
          sequence: S
          children:
            - check: {condition}
            - set: {{n: $s.level, m: {{level: $b}}}}
            - check: $n == 2 and $m.level == 2
        """
    )
    assert tick(root) is Status.SUCCESS
