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


def control(
    request: ControlTree.Request,
    response: ControlTree.Response,
    goals: dict[bytes, ServedGoal],
    halt: Callable[[ServedGoal], None],
    say: Callable[[ServedGoal, str], None],
) -> ControlTree.Response:
    """Carry out the request, or refuse it with a reason.

    `goals` has the goals that run or wait, by their ids; `halt` ends one, `say` logs a line about
    one.
    """
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
        say(goal, f"{word} asked for by {clean(request.requested_by)[:ECHO] or 'a client'}")
        if word == "halt":
            halt(goal)
        else:
            goal.run.pause(word == "pause")
        response.accepted = True
    return response
