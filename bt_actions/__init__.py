"""A behaviour-tree task orchestrator for ROS 2 actions. These names are the public ones."""

from bt_actions.utilities.streams import open_closed_streams as _open_closed_streams

_open_closed_streams()  # before py_trees is imported, which asks for sys.stdout's encoding

# ruff: noqa: E402 - see above
import bt_actions.behaviours.ports as _ports  # noqa: F401 - makes the tags of XML trees known
from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.progress import Progress
from bt_actions.behaviours.robot import Gripper, MoveRobot
from bt_actions.behaviours.run_tree import RunTree
from bt_actions.behaviours.variables import Var
from bt_actions.document import load_tree
from bt_actions.goals.attempts import AttemptRecord
from bt_actions.goals.policy import Busy, End, Outcome, Retry, Timeouts
from bt_actions.running.goals import GoalReport
from bt_actions.running.loop import TreeError
from bt_actions.running.runner import TreeRunner

__all__ = [  # noqa: RUF022 - grouped by use
    # leaves
    "ActionBehaviour",
    "MoveRobot",
    "Gripper",
    "RunTree",
    "Var",
    # policies
    "Timeouts",
    "Retry",
    "Busy",
    # what became of a goal
    "Outcome",
    "End",
    "AttemptRecord",
    "Progress",
    # running
    "load_tree",
    "TreeRunner",
    "TreeError",
    "GoalReport",
]
