"""The service ~/control_tree: pause, resume or halt a run, by its goal's id."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from bt_actions_interfaces.srv import ControlTree

from bt_actions.serving.rejections import ECHO
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.suggest import listing

if TYPE_CHECKING:
    from bt_actions.serving.goal import ServedGoal

COMMANDS = {
    "pause": ControlTree.Request.PAUSE,
    "resume": ControlTree.Request.RESUME,
    "halt": ControlTree.Request.HALT,
}


class Control:
    """The service, which answers one request at a time.

    Args:
        goals: returns the goals that run or wait, by their ids.
        halt: ends one of them.
        say: logs a line about one of them.
    """

    def __init__(
        self,
        goals: Callable[[], dict[bytes, ServedGoal]],
        halt: Callable[[ServedGoal], None],
        say: Callable[[ServedGoal, str], None],
    ) -> None:
        self._goals, self._say = goals, say
        self._does: dict[str, Callable[[ServedGoal], None]] = {
            "pause": lambda goal: goal.run.pause(True),
            "resume": lambda goal: goal.run.pause(False),
            "halt": halt,
        }

    def answer(
        self, request: ControlTree.Request, response: ControlTree.Response
    ) -> ControlTree.Response:
        """Carry out the request, or refuse it with a reason; the callback of the service."""
        goals = self._goals()
        goal_id = bytes(request.goal_id.uuid)
        goal = goals.get(goal_id)
        word = next((each for each in COMMANDS if COMMANDS[each] == request.command), None)
        if word is None:
            known = listing(f"{each} ({number})" for each, number in COMMANDS.items())
            response.message = f"{request.command} is no command; {known} are"
        elif goal is None:
            wrong = f"no goal {goal_id.hex()} runs here" if any(goal_id) else "no goal id is given"
            there = listing(f"{each.id.hex()} ({each.tree})" for each in goals.values())
            response.message = f"{wrong}; {f'there is {there}' if goals else 'nothing runs here'}"
        else:
            asks = clean(request.requested_by)[:ECHO]
            self._say(goal, f"{word} asked for by {asks or 'a client'}")
            self._does[word](goal)
            response.accepted = True
        return response
