"""`make demo` from its start to SUCCESS, beside its motion and a script that does nothing else."""

from __future__ import annotations

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row

MOTION = 1.3
"""Seconds that the simulated robot and gripper move, at ten times their speed."""
DEMO = ["-m", "bt_actions.cli", "run", "trees/pick_and_place.yaml"]
SPEED = ["--sim", "--speed", "10", "--check-part", "5.0"]
SCRIPT = "import rclpy; rclpy.init(); rclpy.create_node('script').destroy_node(); rclpy.shutdown()"


def _demo() -> Figures:
    return {"SUCCESS": processes.seconds_to("SUCCESS", [*DEMO, *SPEED])}


def _script() -> Figures:
    return {"SUCCESS": MOTION + processes.seconds(["-c", SCRIPT])}


FAMILY = Family(
    [
        Row(
            "8",
            "the demo, from start to SUCCESS",
            "its motion (1.3 s), and a script that imports rclpy, makes a node and ends",
            ("demo", "SUCCESS"),
            ("script", "SUCCESS"),
            0.3,
            "s",
            is_difference=True,
        )
    ],
    {"script": _script, "demo": _demo},
)
