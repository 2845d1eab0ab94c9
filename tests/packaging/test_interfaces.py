"""The actions are what the specification says, field by field."""

import re
import sys
from importlib.metadata import PackageNotFoundError, PackagePath, files
from pathlib import Path

import pytest
from robot_control_interfaces.action import Gripper, MoveRobot

SOURCES = Path(__file__).resolve().parents[2] / "interfaces" / "action"


def test_move_robot_takes_a_distance() -> None:
    assert MoveRobot.Goal.get_fields_and_field_types() == {"distance": "double"}


def test_move_robot_ends_with_a_pose_a_status_and_a_message() -> None:
    assert MoveRobot.Result.get_fields_and_field_types() == {
        "final_pose": "double",
        "status": "uint8",
        "message": "string",
    }
    statuses = ("COMPLETED", "CANCELED", "TIMEOUT", "FAULT")
    assert [getattr(MoveRobot.Result, f"STATUS_{name}") for name in statuses] == [0, 1, 2, 3]


def test_move_robot_reports_its_pose_on_the_way() -> None:
    assert MoveRobot.Feedback.get_fields_and_field_types() == {
        "current_pose": "double",
        "status": "uint8",
    }
    statuses = ("READY", "MOVING", "COMPLETED")
    assert [getattr(MoveRobot.Feedback, f"STATUS_{name}") for name in statuses] == [0, 1, 2]


def test_gripper_takes_a_position_and_an_effort() -> None:
    assert Gripper.Goal.get_fields_and_field_types() == {
        "position": "double",
        "max_effort": "double",
    }


@pytest.mark.parametrize("part", ["Result", "Feedback"])
def test_gripper_answers_as_gripper_command_does(part: str) -> None:
    assert getattr(Gripper, part).get_fields_and_field_types() == {
        "position": "double",
        "stalled": "boolean",
        "reached_goal": "boolean",
    }


@pytest.mark.parametrize("action", ["MoveRobot.action", "Gripper.action"])
def test_every_quantity_has_its_unit_beside_it(action: str) -> None:
    lines = (SOURCES / action).read_text().splitlines()
    quantities = [line for line in lines if line.startswith("float64")]
    assert quantities
    for line in quantities:
        assert re.search(r"# .*, (m|N|percent)\b", line), line


def installed_interfaces() -> list[PackagePath]:
    try:
        return files("robot_control_interfaces") or []
    except PackageNotFoundError:
        return []


@pytest.mark.skipif(not installed_interfaces(), reason="the interfaces come from a ROS workspace")
class TestWheel:
    def test_it_was_made_from_these_sources(self) -> None:
        installed = {f.name: f.locate() for f in installed_interfaces() if f.suffix == ".action"}
        assert sorted(installed) == sorted(source.name for source in SOURCES.iterdir())
        for source in SOURCES.iterdir():
            assert Path(installed[source.name]).read_text() == source.read_text()

    def test_it_holds_what_running_needs_and_nothing_for_building(self) -> None:
        prefix = Path(sys.prefix).resolve()
        paths = [Path(file.locate()).resolve() for file in installed_interfaces()]
        names = {str(path.relative_to(prefix)) for path in paths}
        assert "share/ament_index/resource_index/packages/robot_control_interfaces" in names
        assert (
            "share/ament_index/resource_index/rosidl_interfaces/robot_control_interfaces" in names
        )
        assert "lib/librobot_control_interfaces__rosidl_typesupport_fastrtps_c.so" in names
        assert not [name for name in names if name.endswith((".h", ".hpp", ".c", ".cmake", ".sh"))]
