"""The one wording of a running node's work: its time, its limit, and the rule of that limit.

A deadline that stands still, as its tree is paused or this process was stopped, is not known here,
and neither is a ROS clock that runs faster. Such a deadline falls due at another time than told.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from bt_actions.story.actions import ActionStory
from bt_actions.story.failures import Failure
from bt_actions.story.state import NodeStory, State
from bt_actions.story.values import feedback_text, round_text, unmet_text

_STATES = {
    "QUEUED": ("waiting for its turn", "on", "queue"),
    "WAITING_FOR_SERVER": ("waiting for the server", "", "server"),
    "SENDING": ("sending a goal", "to", "accept"),
    "EXECUTING": ("executing", "on", "result"),
    "CANCELING": ("canceling", "on", "cancel"),
}
"""The states of a goal in words, the preposition before its server, and the field of Timeouts
that bounds each."""


class Doing(NamedTuple):
    """The work of a node, in parts; "" for a part that is not known, or needs a time."""

    what: str = ""
    """``executing``"""
    where: str = ""
    """``on /move_robot``"""
    since: str = ""
    """``for 1.9 s``"""
    tries: str = ""
    """``attempt 2 of 3``; of a loop ``item 2 of 3 (4.5)``"""
    until: str = ""
    """``6.1 s left (timeout.result)``"""
    told: str = ""
    """Its feedback, or the node's own message."""

    def __str__(self) -> str:
        does = " ".join(part for part in (self.what, self.where, self.since) if part)
        line = ", ".join(part for part in (does, self.tries, self.until) if part)
        return ": ".join(part for part in (line, self.told) if part)


def doing(state: State, story: NodeStory, now: float | None = None) -> Doing:
    """Return the work of a running node; times only for `now`, in seconds on the steady clock."""
    number, lasting = story.node.id, state.lasting
    if lasting is not None and lasting.node == number:
        begun = lasting.at.steady - lasting.seconds
        return Doing(f"in its tick {_for(begun, now)}".rstrip())
    action = state.action(number) if state.acts(number) else None
    until = ""
    if now is not None and (dues := [*_deadlines(action, now), *_own_times(state, story, now)]):
        left, rule = min(dues)
        until = f"{_seconds(left)} left{rule and f' ({rule})'}"
    goal = action.latest if action is not None else None
    if action is None or goal is None:
        since = _for(story.since.steady, now) if story.since is not None else ""
        told = story.message if story.is_leaf else ""
        tries = round_text(story.round) if story.round is not None else ""
        return Doing(since=since and f"running {since}", tries=tries, until=until, told=told)
    if goal.verdict is not None and (pause := goal.verdict.again_in) is not None:
        left_of = "" if now is None else f" in {_seconds(goal.verdict.at.steady + pause - now)}"
        tries = _tries(action.attempt + 1, action.of)
        told = f"{action.outcome}: {unmet_text(goal) or action.reason}"
        return Doing(f"trying again{left_of}", tries=tries, until=until, told=told)
    does = goal_doing(action.state, action.server, action.attempt, action.of)
    since = _for(goal.since.steady, now)
    return does._replace(since=since, until=until, told=feedback_text(action))


def did_text(stopped: Failure) -> str:
    """Say what a node did that the end of the run has stopped, and for how long."""
    what = "in its tick" if stopped.in_tick else "running"
    told = "" if stopped.in_tick or stopped.attempts else stopped.message
    return str(Doing(what, since=_for(0.0, stopped.ran), told=told))


def goal_doing(state: str, server: str, attempt: int, of: int) -> Doing:
    """Return the standing of a goal without an outcome."""
    what, to, _ = _STATES.get(state, (state.lower(), "on", ""))
    return Doing(what, f"{to} {server}".lstrip(), tries=_tries(attempt, of))


def _tries(attempt: int, of: int) -> str:
    """Say which attempt it is, but for the first."""
    return f"attempt {attempt} of {of}" if attempt > 1 else ""


def _deadlines(action: ActionStory | None, now: float) -> Iterator[tuple[float, str]]:
    """Yield the seconds left of each deadline of an action's goal, and its name."""
    goal = action.latest if action is not None else None
    timeouts = action.node.settings.get("timeouts") if action is not None else None
    if goal is None or not isinstance(timeouts, dict):
        return
    _, _, phase = _STATES.get(goal.latest.state, ("", "", ""))
    begun = {phase: goal.since}
    if phase == "result":
        begun["feedback"] = goal.since if goal.feedback is None else goal.feedback.at
    for name, since in begun.items():
        if isinstance(limit := timeouts.get(name), int | float):
            yield max(0.0, since.steady + limit - now), f"timeout.{name}"


def _own_times(state: State, story: NodeStory, now: float) -> Iterator[tuple[float, str]]:
    """Yield the seconds left of a node's own time; for a leaf, also of the nodes that hold it."""
    for each in (story, *(state.above(story.node.id) if story.is_leaf else ())):
        if each.due_in is not None and each.since is not None:
            left = each.since.steady + each.due_in - now
            if left > 0.0:
                yield left, "" if each is story else each.node.name


def _for(since: float, now: float | None) -> str:
    return "" if now is None else f"for {_seconds(now - since)}"


def _seconds(seconds: float) -> str:
    seconds = max(0.0, seconds)
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"
