"""What the importer has left to be written, written: on paths and poses that stand for others."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator


class TruncatePath(Behaviour):
    """Leave off the end of a path: here its frame says so, and the poses stay."""

    inputs: Any
    outputs: Any

    def update(self) -> Status:
        shorter = copy.deepcopy(self.inputs.input_path)
        shorter.header.frame_id += f" less {self.inputs.distance} m"
        self.outputs.output_path = shorter
        return Status.SUCCESS


class RemovePassedGoals(Behaviour):
    """Leave out the goals near the robot, which is at the origin here."""

    inputs: Any
    outputs: Any

    def update(self) -> Status:
        ahead = copy.deepcopy(self.inputs.input_goals)
        ahead.goals = [goal for goal in ahead.goals if goal.pose.position.x > self.inputs.radius]
        self.outputs.output_goals = ahead
        return Status.SUCCESS


class Paced(Decorator):
    """Ticks its child at once, and again when `is_due` says so; until then it is RUNNING."""

    inputs: Any
    _held = False
    """Whether the child has succeeded, and is not due."""

    def is_due(self) -> bool:
        raise NotImplementedError

    def begun(self) -> None:
        """Take note that the child has succeeded."""

    def tick(self) -> Iterator[Behaviour]:
        if self._held and not self.is_due():
            self.status = Status.RUNNING
            yield self
            return
        self._held = False
        yield from super().tick()

    def update(self) -> Status:
        if self.decorated.status is Status.SUCCESS:
            self._held = True
            self.begun()
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:
        if new_status is not Status.SUCCESS:
            self._held = False


class EachDistance(Paced):
    """Nav2's DistanceController: due when the robot has moved that far since."""

    def begun(self) -> None:
        self._at = self.inputs.odometry.pose.pose.position

    def is_due(self) -> bool:
        now = self.inputs.odometry.pose.pose.position
        moved = math.dist((now.x, now.y, now.z), (self._at.x, self._at.y, self._at.z))
        return bool(moved >= self.inputs.distance)


class AtSpeed(Paced):
    """Nav2's SpeedController: due the sooner the faster the robot was."""

    def begun(self) -> None:
        self._since = time.monotonic()

    def is_due(self) -> bool:
        given = self.inputs
        speed = abs(given.odometry.twist.twist.linear.x) - given.min_speed
        part = min(1.0, max(0.0, speed / (given.max_speed - given.min_speed)))
        rate = given.min_rate + part * (given.max_rate - given.min_rate)
        return bool(time.monotonic() - self._since >= 1.0 / rate)


class PathLongerOnApproach(Decorator):
    """Ticks its child where the way to the goal was short and has become long: in poses here."""

    inputs: Any
    _path: Any = None

    def tick(self) -> Iterator[Behaviour]:
        if self.status is not Status.RUNNING:
            before, self._path = self._path, self.inputs.path
            if before is None or not self._is_longer(before.poses, self._path.poses):
                self.stop(Status.SUCCESS)
                yield self
                return
        yield from super().tick()

    def _is_longer(self, before: list[Any], now: list[Any]) -> bool:
        ends_there = before[-1:] == now[-1:]
        near = len(before) < self.inputs.prox_len
        return bool(ends_there and near and len(now) > self.inputs.length_factor * len(before))

    def update(self) -> Status:
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID:
            self._path = None
