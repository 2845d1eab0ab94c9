"""A behaviour-tree task orchestrator for ROS 2 actions. These names are the public ones.

A name is imported when a program first asks for it: a program pays for what it uses.
"""

import sys as _sys
from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

from bt_actions.utilities.streams import open_closed_streams as _open_closed_streams

_open_closed_streams()  # before py_trees is imported, which asks for sys.stdout's encoding

if _TYPE_CHECKING:
    from bt_actions.behaviours.action import ActionBehaviour, Progress
    from bt_actions.behaviours.composites import InTurn, Pipeline, Recover
    from bt_actions.behaviours.decorators import Every
    from bt_actions.behaviours.robot import Gripper, MoveRobot
    from bt_actions.behaviours.run_tree import RunTree
    from bt_actions.behaviours.variables import Var
    from bt_actions.document import load_tree
    from bt_actions.goals.attempts import AttemptRecord
    from bt_actions.goals.policy import Busy, End, Outcome, Retry, Timeouts
    from bt_actions.goals.unaccounted import GoalReport
    from bt_actions.running.runner import TreeRunner
    from bt_actions.running.telling import TreeError

__all__ = [  # noqa: RUF022 - grouped by use
    # leaves
    "ActionBehaviour",
    "MoveRobot",
    "Gripper",
    "RunTree",
    "Var",
    # composites, and what holds a child back
    "Recover",
    "Pipeline",
    "Every",
    "InTurn",
    # policies
    "Timeouts",
    "Retry",
    "Busy",
    # outcomes and ends of goals
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

_PLACES = {
    "behaviours.action": ["ActionBehaviour", "Progress"],
    "behaviours.composites": ["InTurn", "Pipeline", "Recover"],
    "behaviours.decorators": ["Every"],
    "behaviours.robot": ["Gripper", "MoveRobot"],
    "behaviours.run_tree": ["RunTree"],
    "behaviours.variables": ["Var"],
    "document": ["load_tree"],
    "goals.attempts": ["AttemptRecord"],
    "goals.policy": ["Busy", "End", "Outcome", "Retry", "Timeouts"],
    "goals.unaccounted": ["GoalReport"],
    "running.telling": ["TreeError"],
    "running.runner": ["TreeRunner"],
}
_PLACE_OF = {name: place for place, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _PLACE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(_import_module(f"{__name__}.{_PLACE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _XmlTags:
    """A hook that teaches py_trees' parsers of XML trees the tags of our leaves at import."""

    @staticmethod
    def find_spec(name: str, *_: object) -> None:
        """Find nothing: the usual finders do."""
        if name == "py_trees.parsers":
            _import_module("bt_actions.behaviours.ports")


if "py_trees.parsers" in _sys.modules:
    _XmlTags.find_spec("py_trees.parsers")
else:
    _sys.meta_path.insert(0, _XmlTags())
