"""The client of servers of trees in sight: their trees, their rejections, and control.

All of it blocks for some seconds.
"""

from __future__ import annotations

from bt_actions_interfaces.msg import Rejection, TreeInfo
from bt_actions_interfaces.srv import ControlTree, ListTrees
from unique_identifier_msgs.msg import UUID

from bt_actions.ros.serving.questions import asking
from bt_actions.serving.control import COMMANDS
from bt_actions.serving.rejections import REJECTIONS
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.suggest import listing


class NotControlled(Exception):
    """A command that was not carried out. `unclear`: the run that is meant is not clear."""

    def __init__(self, message: str, *, unclear: bool = False) -> None:
        super().__init__(clean(message))
        self.unclear = unclear


def control(action: str, command: str, beginning: str) -> str:
    """Have a server pause, resume or halt the run whose id begins so; return the name of that run.

    `action` is its full name; without a beginning, the one run there is. Raises NotControlled.
    """
    with asking() as asker:
        place, _, own = action.rpartition("/")
        found = own == "run_tree" and asker.find(
            ListTrees, lambda name: name.rsplit("/", 2)[0] == place
        )
        if not found:
            raise NotControlled(
                f"no server of trees offers {action}; is `bt-actions serve` running, in this "
                "ROS_DOMAIN_ID, and in this namespace?"
            )
        told = asker.ask(ListTrees, found, ListTrees.Request())
        if told is None:
            raise NotControlled(f"{found} does not answer")
        runs = {
            bytes(each.uuid).hex(): clean(tree.name)
            for tree in told.trees
            for each in tree.running
            if beginning or each not in tree.waiting
        }
        goal_id = _chosen(action, runs, beginning)
        request = ControlTree.Request(
            command=COMMANDS[command],
            goal_id=UUID(uuid=list(bytes.fromhex(goal_id))),
            requested_by="bt-actions control",
        )
        service = f"{found.removesuffix('/list_trees')}/control_tree"
        answer = asker.ask(ControlTree, service, request)
    if answer is None:
        raise NotControlled(f"{service} does not answer")
    if not answer.accepted:
        raise NotControlled(answer.message)
    return f"{runs[goal_id]} {goal_id}"


def _chosen(action: str, runs: dict[str, str], beginning: str) -> str:
    chosen = [goal_id for goal_id in runs if goal_id.startswith(beginning)]
    if len(chosen) == 1:
        return chosen[0]
    there = listing(f"{goal_id} ({tree})" for goal_id, tree in runs.items())
    if not runs:
        raise NotControlled(f"no tree runs at {action}")
    if not chosen:
        raise NotControlled(
            f"no run at {action} has an id that begins so; there is {there}", unclear=True
        )
    raise NotControlled(f"which one? Give the beginning of one of {there}", unclear=True)


def why_rejected(goal_name: str) -> Rejection | None:
    """Return the first rejection of a goal of this name from any server in sight."""
    with asking() as asker:
        rejections = asker.heard(Rejection, REJECTIONS)
        return next((each for each in rejections if each.goal_name == goal_name), None)


def trees_in_sight(namespace: str = "") -> dict[str, list[TreeInfo] | None]:
    """Return the trees of the servers below a namespace, by node; None: no answer."""
    with asking() as asker:
        return {
            service.removesuffix("/list_trees"): None if told is None else list(told.trees)
            for service, told in asker.answers(ListTrees, namespace).items()
        }
