"""The action server that opens and closes the simulated gripper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot_control_interfaces.action import Gripper

from bt_actions.simulation import gripper
from bt_actions.simulation.goal_meaning import Finish
from bt_actions.simulation.gripper import GripperSimulator
from bt_actions.simulation.move_robot import TIME_LIMIT
from bt_actions.simulation.server import SimulatedServer
from bt_actions.simulation.world import World


class _Grip:
    def __init__(self, world: World, position: float) -> None:
        self._world = world
        self._start = world.gripper.position
        self._position = position
        self.gripper: GripperSimulator = world.gripper
        self.gripper.set_goal(position)

    @property
    def progress(self) -> float:
        way = abs(self._position - self._start)
        return 1.0 if way == 0.0 else 1.0 - abs(self._position - self.gripper.position) / way

    @property
    def reached(self) -> bool:
        """Whether the fingers are at this goal's target."""
        return self.gripper.position == self._position

    @property
    def done(self) -> bool:
        return self.gripper.done

    def step(self, share: float) -> None:
        self._world.move_gripper(share)


class GripperServer(SimulatedServer):
    """The server of Gripper. Fingers that stall on the part have succeeded, with `stalled` true.

    A newer goal aborts the older: there is one pair of fingers.
    """

    def __init__(
        self, node: Any, world: World, name: str = "gripper_control", **settings: Any
    ) -> None:
        """Serve the gripper of `world`; `settings` are those of SimulatedServer."""
        self.world = world
        super().__init__(node, Gripper, name, **{"time_limit": TIME_LIMIT} | settings)

    def refusal(self, goal: Any) -> str | None:
        return gripper.refusal(goal.position, goal.max_effort)

    def begin(self, goal: Any) -> _Grip:
        return _Grip(self.world, goal.position)

    def feedback(self, motion: Any) -> Any:
        return self._filled(Gripper.Feedback, motion)

    def result(self, motion: Any, finish: Finish, reason: str) -> Any:
        return self._filled(Gripper.Result, motion)

    def halt(self, motion: Any) -> None:
        self.world.gripper.stop()

    def drop_part(self) -> None:
        self.world.drop()

    def state(self, motion: Any) -> Mapping[str, float]:
        return {"position": self.world.gripper.position}

    def _filled(self, message_type: Any, motion: Any) -> Any:
        return message_type(
            position=motion.gripper.position,
            stalled=motion.gripper.stalled,
            reached_goal=motion.reached,
        )
