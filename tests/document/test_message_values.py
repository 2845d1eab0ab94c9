"""Variables, expressions and constants inside the messages that a tree writes."""

from __future__ import annotations

import pytest

from bt_actions.document import check_source, source_of


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


def test_a_variable_in_an_array_must_fit_its_items() -> None:
    found = said("std_msgs/msg/Int32MultiArray", "{data: [1, $a]}")
    assert found == ["BT204 an int32 is needed, and $a is a float64"]
