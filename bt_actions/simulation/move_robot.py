"""The action server that drives the simulated robot along its axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot_control_interfaces.action import MoveRobot

from bt_actions.simulation import robot
from bt_actions.simulation.goal_meaning import Finish
from bt_actions.simulation.robot import RobotSimulator, RobotStatus
from bt_actions.simulation.server import SimulatedServer
from bt_actions.simulation.world import World

TIME_LIMIT = 30.0
"""Seconds of simulated time after which the server gives up a goal."""

_STATUS = {
    Finish.COMPLETED: MoveRobot.Result.STATUS_COMPLETED,
    Finish.CANCELED: MoveRobot.Result.STATUS_CANCELED,
    Finish.TIMEOUT: MoveRobot.Result.STATUS_TIMEOUT,
}


class _Drive:
    def __init__(self, world: World, distance: float) -> None:
        self._world = world
        self._start = world.robot.current_pose
        self._distance = distance
        self.robot: RobotSimulator = world.robot
        self.robot.set_goal(distance)

    @property
    def progress(self) -> float:
        way = abs(self._distance - self._start)
        return 1.0 if way == 0.0 else 1.0 - abs(self._distance - self.robot.current_pose) / way

    @property
    def done(self) -> bool:
        return self.robot.get_status() is RobotStatus.COMPLETED

    def step(self, share: float) -> None:
        self._world.move_robot(share)


class MoveRobotServer(SimulatedServer):
    """The server of MoveRobot, which drives the robot of `world`, with the part in its gripper.

    A newer goal aborts the older: there is one axis.
    """

    def __init__(self, node: Any, world: World, name: str = "move_robot", **settings: Any) -> None:
        """Serve the robot of `world`; `settings` are those of SimulatedServer."""
        self.world = world
        super().__init__(node, MoveRobot, name, **{"time_limit": TIME_LIMIT} | settings)

    def refusal(self, goal: Any) -> str | None:
        return robot.refusal(goal.distance)

    def begin(self, goal: Any) -> _Drive:
        return _Drive(self.world, goal.distance)

    def feedback(self, motion: Any) -> Any:
        return MoveRobot.Feedback(
            current_pose=motion.robot.current_pose, status=int(motion.robot.get_status())
        )

    def result(self, motion: Any, finish: Finish, reason: str) -> Any:
        status = _STATUS.get(finish, MoveRobot.Result.STATUS_FAULT)
        pose = self.world.robot.current_pose
        return MoveRobot.Result(final_pose=pose, status=status, message=reason)

    def halt(self, motion: Any) -> None:
        self.world.robot.stop()

    def drop_part(self) -> None:
        self.world.drop()

    def state(self, motion: Any) -> Mapping[str, float]:
        return {"pose": round(self.world.robot.current_pose, 6)}
