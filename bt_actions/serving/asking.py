"""Questions to servers of trees in sight, from outside: which trees, and why a goal was rejected.

Both block for some seconds.
"""

from __future__ import annotations

import contextlib

from bt_actions_interfaces.msg import Rejection, TreeInfo
from bt_actions_interfaces.srv import ListTrees

from bt_actions.ros.serving.asking import answers, heard
from bt_actions.serving.rejections import REJECTIONS

__all__ = ["trees_in_sight", "why_rejected"]


def why_rejected(goal_name: str) -> Rejection | None:
    """The first rejection of a goal of this name that any server in sight tells of."""
    with contextlib.closing(heard(Rejection, REJECTIONS)) as rejections:
        return next((each for each in rejections if each.goal_name == goal_name), None)


def trees_in_sight(namespace: str = "") -> dict[str, list[TreeInfo] | None]:
    """The trees of each server below a namespace, by its node's name; None: it does not answer."""
    return {
        service.removesuffix("/list_trees"): None if told is None else list(told.trees)
        for service, told in answers(ListTrees, namespace).items()
    }
