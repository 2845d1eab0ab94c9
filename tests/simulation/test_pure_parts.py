"""Only what stands in simulation/ros needs rclpy; the rest can be used and tested without."""

import subprocess
import sys

import pytest

from bt_actions import simulation


def test_without_rclpy_all_but_the_node_is_there() -> None:
    program = (
        "import sys, pkgutil, importlib\n"
        "sys.modules['rclpy'] = None\n"
        "import bt_actions.simulation as simulation\n"
        "assert 'robot_control_interfaces' not in sys.modules\n"
        "for module in pkgutil.iter_modules(simulation.__path__, 'bt_actions.simulation.'):\n"
        "    importlib.import_module(module.name)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_public_names_are_all_there() -> None:
    for name in simulation.__all__:
        assert getattr(simulation, name).__name__ == name
    with pytest.raises(AttributeError, match="Simulatoin"):
        getattr(simulation, "Simulatoin")  # noqa: B009 - mypy would see the plain one
