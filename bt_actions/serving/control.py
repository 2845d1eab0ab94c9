"""Pause, resume or halt a run, for whoever asks by its goal's id: the service ~/control_tree."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from bt_actions_interfaces.srv import ControlTree

from bt_actions.serving.goal import Goal
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.suggest import listing

ECHO = 200
"""Characters of the caller's own words in what is said of it."""


class Step(NamedTuple):
    """What a command does."""

    word: str
    do: Callable[[Goal], None]


class Control:
    """Answers one request at a time.

    Args:
        goals: returns the goals that run or wait, by their ids.
        halt: ends one of them.
        say: says of one of them what is done with it.
    """

    def __init__(
        self,
        goals: Callable[[], dict[bytes, Goal]],
        halt: Callable[[Goal], None],
        say: Callable[[Goal, str], None],
    ) -> None:
        self._goals, self._say = goals, say
        self._steps = {
            ControlTree.Request.PAUSE: Step("pause", lambda goal: goal.run.pause()),
            ControlTree.Request.RESUME: Step("resume", lambda goal: goal.run.resume()),
            ControlTree.Request.HALT: Step("halt", halt),
        }

    def answer(
        self, request: ControlTree.Request, response: ControlTree.Response
    ) -> ControlTree.Response:
        """Do what is asked for, or say why not; the callback of the service."""
        goals = self._goals()
        goal_id = bytes(request.goal_id.uuid)
        goal, step = goals.get(goal_id), self._steps.get(request.command)
        if step is None:
            known = listing(f"{each.word} ({number})" for number, each in self._steps.items())
            response.message = f"{request.command} is no command; {known} are"
        elif goal is None:
            wrong = f"no goal {goal_id.hex()} runs here" if any(goal_id) else "no goal id is given"
            there = listing(f"{each.id.hex()} ({each.tree})" for each in goals.values())
            response.message = f"{wrong}; {f'there is {there}' if goals else 'nothing runs here'}"
        else:
            asks = clean(request.requested_by)[:ECHO]
            self._say(goal, f"{step.word} asked for by {asks or 'a client'}")
            step.do(goal)
            response.accepted = True
        return response
