"""What the importer has left to be written, written: on paths and poses that stand for others."""

from __future__ import annotations

import copy
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status


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
