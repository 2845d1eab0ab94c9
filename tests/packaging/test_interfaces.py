"""The interfaces are what the specification says, field by field."""

import re
import sys
from importlib.metadata import PackageNotFoundError, PackagePath, files
from pathlib import Path

import pytest
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport
from bt_actions_interfaces.srv import ControlTree
from robot_control_interfaces.action import Gripper

from bt_actions.goals.policy import End, Outcome

INTERFACES = Path(__file__).resolve().parents[2] / "interfaces"
PACKAGES = ["bt_actions_interfaces", "robot_control_interfaces"]


@pytest.mark.parametrize("part", ["Result", "Feedback"])
def test_gripper_answers_as_gripper_command_does(part: str) -> None:
    assert getattr(Gripper, part).get_fields_and_field_types() == {
        "position": "double",
        "stalled": "boolean",
        "reached_goal": "boolean",
    }


@pytest.mark.parametrize("action", ["MoveRobot.action", "Gripper.action"])
def test_every_quantity_has_its_unit_beside_it(action: str) -> None:
    source = INTERFACES / "robot_control_interfaces" / "action" / action
    lines = source.read_text().splitlines()
    quantities = [line for line in lines if line.startswith("float64")]
    assert quantities
    for line in quantities:
        assert re.search(r"# .*, (m|N|percent)\b", line), line


def constants(message: type) -> dict[str, int]:
    """The constants of a message; each is an attribute of its class's class."""
    return {
        name: value.fget(message)
        for name, value in vars(type(message)).items()
        if isinstance(value, property)
    }


def test_run_tree_is_asked_for_a_tree_by_its_name() -> None:
    assert RunTree.Goal.get_fields_and_field_types() == {
        "tree": "string",
        "inputs": "string",
        "goal_name": "string",
        "caller_run": "string",
    }


def test_run_tree_tells_whether_every_goal_below_has_ended() -> None:
    assert RunTree.Result.get_fields_and_field_types() == {
        "error_code": "uint16",
        "error_msg": "string",
        "outputs": "string",
        "settled": "boolean",
        "recording": "string",
        "actions": "sequence<bt_actions_interfaces/ActionReport>",
    }


def test_the_error_codes_of_run_tree_lie_above_those_of_nav2() -> None:
    codes = constants(RunTree.Result)
    assert codes.pop("NONE") == 0
    assert sorted(codes.values()) == [*range(20000, 20008), 20100]


def test_run_tree_reports_three_leaves_at_most() -> None:
    assert RunTree.Feedback.get_fields_and_field_types() == {
        "running": "sequence<bt_actions_interfaces/RunningLeaf, 3>",
        "leaves_ended": "uint32",
        "paused": "boolean",
        "waiting": "boolean",
    }


def test_an_action_report_has_a_constant_for_each_outcome_and_end() -> None:
    codes = constants(ActionReport)
    ends = {name for name in codes if name.startswith("END_")}
    assert ends == {f"END_{end.value}" for end in End}
    assert codes.keys() - ends == {"NOT_ENDED", *(outcome.value for outcome in Outcome)}
    for names in (ends, codes.keys() - ends):
        assert sorted(codes[name] for name in names) == list(range(len(names)))
    assert codes["END_UNKNOWN"] == 0  # what nobody has filled in is not taken for an end


def test_a_control_that_was_not_filled_in_is_none() -> None:
    assert sorted(constants(ControlTree.Request).values()) == [1, 2, 3]


def installed_interfaces(package: str) -> list[PackagePath]:
    try:
        return files(package) or []
    except PackageNotFoundError:
        return []


@pytest.mark.skipif(
    not all(map(installed_interfaces, PACKAGES)), reason="the interfaces come from a ROS workspace"
)
@pytest.mark.parametrize("package", PACKAGES)
class TestWheel:
    def test_it_was_made_from_these_sources(self, package: str) -> None:
        suffixes = {".action", ".msg", ".srv"}
        sources = [each for each in (INTERFACES / package).rglob("*") if each.suffix in suffixes]
        installed = {
            f.name: Path(f.locate()) for f in installed_interfaces(package) if f.suffix in suffixes
        }
        assert sources
        for source in sources:
            assert installed[source.name].read_text() == source.read_text()

    def test_it_holds_what_running_needs_and_what_building_upon_it_needs(
        self, package: str
    ) -> None:
        prefix = Path(sys.prefix).resolve()
        paths = [Path(file.locate()).resolve() for file in installed_interfaces(package)]
        names = {str(path.relative_to(prefix)) for path in paths}
        index = "share/ament_index/resource_index"
        assert {f"{index}/packages/{package}", f"{index}/rosidl_interfaces/{package}"} <= names
        assert f"lib/lib{package}__rosidl_typesupport_fastrtps_c.so" in names
        assert f"share/{package}/cmake/{package}Config.cmake" in names
        assert any(name.startswith(f"include/{package}/") for name in names)
        assert not [name for name in names if name.endswith(".sh")]

    def test_nothing_in_it_names_the_machine_that_built_it(self, package: str) -> None:
        for file in installed_interfaces(package):
            if file.suffix == ".cmake":
                text = Path(file.locate()).read_text()
                assert not re.search(r'[";](/|[A-Z]:)\w', text), file
