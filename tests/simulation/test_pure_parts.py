"""Robot, world, faults and journal import without ROS, so they can be used and tested without."""

import subprocess
import sys

import pytest

PURE = [
    "battery", "execution", "fault_plan", "faults", "gripper", "intake", "journal",
    "result_faults", "robot", "world",
]  # fmt: skip


@pytest.mark.parametrize("module", ["", *(f".{name}" for name in PURE)])
def test_it_imports_no_ros(module: str) -> None:
    program = (
        f"import bt_actions.simulation{module}, sys\n"
        "ros = [m for m in sys.modules if m.split('.')[0] in ('rclpy', 'robot_control_interfaces')]\n"  # noqa: E501
        "sys.exit(str(ros) if ros else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_public_names_are_all_there() -> None:
    from bt_actions import simulation

    for name in simulation.__all__:
        assert getattr(simulation, name).__name__ == name
    with pytest.raises(AttributeError, match="Simulatoin"):
        getattr(simulation, "Simulatoin")  # noqa: B009 - mypy would see the plain one
