"""The reasons of rejections, told to all: ROS gives a rejection no reason. Decides nothing."""

from __future__ import annotations

from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import Rejection

from bt_actions.ros.rosout import Tell
from bt_actions.ros.serving.endpoints import Endpoints, kept
from bt_actions.serving.requests import GoalRefused
from bt_actions.utilities.plain_text import clean

REJECTIONS = 10
ECHO = 200
"""Characters of a client's own words in a message about them."""


class Rejections:
    """The log, and the topic ``~/rejections``, which keeps the last ten."""

    def __init__(self, endpoints: Endpoints, say: Tell) -> None:
        self._say = say
        self._node = endpoints.node
        self._publisher = endpoints.publisher(Rejection, "~/rejections", kept(REJECTIONS))

    def tell(self, goal: RunTree.Goal, refused: GoalRefused) -> None:
        """Tell why a goal is rejected."""
        said = refused.finding
        place = f" ({said.place})" if said.place else ""
        called = f", called {clean(goal.goal_name)[:ECHO]!r}," if goal.goal_name else ""
        self._say("warn", f"goal for {clean(goal.tree)[:ECHO]!r}{called} rejected: {said.code}: "
                          f"{said.message}{place}")  # fmt: skip
        self._publisher.publish(
            Rejection(
                stamp=self._node.get_clock().now().to_msg(),
                tree=clean(goal.tree)[:ECHO],
                goal_name=clean(goal.goal_name)[:ECHO],
                code=said.code,
                message=f"{said.message}{place}",
            )
        )
