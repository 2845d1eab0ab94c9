"""Steps of a goal that was not sent yet: it waits for resources, then for a server."""

from __future__ import annotations

from typing import Any

from bt_actions.goals.facts import Facts
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.steps.step import Step, leads_to
from bt_actions.goals.terms import Command, Event, State


def give_up(outcome: Outcome, why: str) -> Step:
    """Return the step that ends what was not sent."""

    def step(goal: Facts, detail: Any) -> State:
        goal.settle(outcome, goal.say(why, detail))
        return State.DONE

    return Step(step, frozenset({State.DONE}), f"Give up: {outcome}")


@leads_to(State.WAITING_FOR_SERVER)
def granted(goal: Facts, detail: Any) -> State:
    """Hold the resources, and wait for the server."""
    goal.deadlines.disarm(Event.QUEUE_DUE)
    goal.deadlines.arm(Event.SERVER_DUE, goal.timeouts.server)
    return State.WAITING_FOR_SERVER


@leads_to(State.SENDING)
def send(goal: Facts, detail: Any) -> State:
    """Send it; until the server says how it ended, its end is UNKNOWN."""
    goal.deadlines.disarm(Event.SERVER_DUE)
    goal.deadlines.suspend(0.0, goal.deadlines.now)  # it was for a server that is out of sight
    goal.deadlines.arm(Event.ACCEPT_DUE, goal.timeouts.accept)
    goal.end = End.UNKNOWN
    goal.commands.append(Command.SEND)
    return State.SENDING


@leads_to(State.DONE)
def send_failed(goal: Facts, detail: Any) -> State:
    """Give up: SERVER_UNAVAILABLE; nothing was started."""
    goal.end = End.NEVER_STARTED
    why = f"the goal request could not be sent: {detail}"
    goal.settle(goal.planned or Outcome.SERVER_UNAVAILABLE, why)
    return State.DONE
