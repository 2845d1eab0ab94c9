"""A recorded run as lines for people: one for each event that they care for.

A node gets a line when it ends, a goal when it is sent and when its leaf has judged it. Feedback,
and statuses within a tick, have none.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    ClockJumped,
    Event,
    EventsLost,
    GoalChanged,
    Logged,
    Moment,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    Paused,
    RoundBegan,
    RunBegan,
    RunEnded,
    ServerSeen,
    StopWanted,
    TickLasts,
    TreeFinished,
    VariableWritten,
)
from bt_actions.events.bare import bare
from bt_actions.events.kinds import LEFT_OUT
from bt_actions.goals.policy import Outcome
from bt_actions.recording.reading import Item, Recording
from bt_actions.story.actions import DONE, ActionStory, GoalStory
from bt_actions.story.bare import stripped
from bt_actions.story.state import OVER, State
from bt_actions.story.values import clock, opened
from bt_actions.story.why import attempt_text
from bt_actions.story.words import error_text
from bt_actions.utilities.names import told_apart
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import brief, fit, shorten

WAITED = 1.0
"""Seconds that a goal waited before it was sent, from which on the wait is told."""


@dataclass(frozen=True, slots=True)
class Line:
    """One event in words."""

    at: Moment
    seconds: float
    """Seconds since the run began."""
    kind: str
    """SUCCESS, FAILURE, STOPPED, left out, goal, round, variable, log, server, ..."""
    text: str
    node: int | None = None
    path: tuple[str, ...] = ()
    """The names from the root down to the node."""

    def __str__(self) -> str:
        """Return the line as it stands in a text."""
        return fit(f"{self.seconds:9.2f} s  {clock(self.at.wall)}  {self.kind:<8}  {self.text}")


class Timeline:
    """The lines of a recording, in order; `state` is the state behind the last of them."""

    def __init__(self, recording: Recording, *, values: bool = True) -> None:
        """Make the lines; without `values`, no value of the robot's is told, or kept in `state`."""
        self.recording, self._values = recording, values
        self.state = State()
        self.lost = 0
        """Events that are missing in the recording."""
        self._names: dict[tuple[str, ...], str] = {}
        self._alike: defaultdict[str, list[int]]
        """The nodes by name: a path is made only of those that share one."""

    def __iter__(self) -> Iterator[Line]:
        """Read the recording. Raises RecordingError."""
        for item in self.recording.items():
            told = item if self._values else _bared(item)
            if isinstance(told, State):
                self.state = told
                self._names.clear()
            elif told is not None:
                yield from self._told(told)

    def _told(self, event: Event) -> Iterator[Line]:
        state, node = self.state, getattr(event, "node", None)
        was = state.status_of(node) if isinstance(node, int) else Status.INVALID
        state.fold(event)
        if isinstance(node, int) and node not in state.nodes:
            return
        if isinstance(event, RunBegan | NodesAdded | NodesRemoved):
            self._names.clear()
        kind, text = self._words(event, was)
        if not kind:
            return
        path = state.path(node) if isinstance(node, int) else ()
        name = "" if isinstance(event, Logged) else self._called(path)
        text = clean(": ".join(each for each in (name, text) if each))
        yield Line(event.at, event.at.steady - state.started, kind, text, node, path)

    def _called(self, path: tuple[str, ...]) -> str:
        """Return a node's name, behind the part of its path that tells it apart from others."""
        if path and path not in self._names:
            if not self._names:
                self._alike = defaultdict(list)
                for number, story in self.state.nodes.items():
                    self._alike[story.node.name].append(number)
            self._names |= told_apart(map(self.state.path, self._alike[path[-1]]))
        return self._names.get(path, "")

    def _words(self, event: Event, was: Status) -> tuple[str, str]:
        """Return the kind of an event's line, and its text; "" for an event without a line."""
        match event:
            case NodeChanged():
                return self._node(event, was)
            case GoalChanged():
                text = self._goal(event)
                return ("goal", text) if text else ("", "")
            case AttemptEnded(again_in=float()):
                return self._again(event)
            case TickLasts():
                took = "has taken" if event.is_over else "lasts, by now for"
                return "tick", f"its tick {took} {event.seconds:.1f} s"
            case RoundBegan():
                of = "" if event.of is None else f" of {event.of}"
                word = "round" if event.item is None else "item"
                item = "" if event.item is None else f": {shorten(event.item)}"
                return "round", f"{word} {event.number + 1}{of}{item}"
            case VariableWritten():
                return "variable", f"${event.name} = {shorten(event.value)}"
            case ServerSeen():
                comes = "comes in" if event.in_sight else "goes out of"
                return "server", f"{event.server} {comes} sight"
            case Logged():
                level = "" if event.level == "info" else f"{event.level}: "
                return "log", f"{level}{event.text}"
            case _:
                return self._of_the_run(event)

    def _of_the_run(self, event: Event) -> tuple[str, str]:
        match event:
            case NodesAdded():
                names = shorten([each.name for each in event.nodes])
                return "nodes", f"{len(event.nodes)} inserted: {names}"
            case NodesRemoved():
                return "nodes", f"{len(event.nodes)} taken out"
            case ClockJumped():
                return "clock", f"the {event.clock} clock jumped by {event.seconds:+.2f} s"
            case Paused():
                return "pause", "paused: no goal is begun" if event.paused else "goes on"
            case StopWanted():
                return "stop", f"{event.why} ({event.who})"
            case EventsLost():
                self.lost += event.count
                return "lost", f"{event.count} events are not in the recording"
            case TreeFinished(error=str(error)) if error:
                return "tree", error
            case RunEnded():
                is_served = self.state.began is not None and self.state.began.request
                error = error_text(self.state)
                code = f"{'error' if is_served else 'exit'} code {event.exit_code}"
                return "end", f"{code}{f': {error}' if error else ''}"
        return "", ""

    def _node(self, event: NodeChanged, was: Status) -> tuple[str, str]:
        """Return the words for a node that has ended, or a leaf that was stopped."""
        story, state = self.state.nodes[event.node], self.state
        is_stopped = event.status is Status.INVALID and was is Status.RUNNING and story.is_leaf
        if event.status not in OVER and not is_stopped:
            return "", ""
        if event.is_left_out:
            return LEFT_OUT, brief(event.why_left_out)
        if story.node.kind == "log" and event.status is Status.SUCCESS:  # its message has a line
            return "", ""
        text = event.warning or event.message
        action = state.action(event.node) if state.acts(event.node) else None
        if action is not None and action.latest is not None and event.status in OVER:
            text = _judged(action, action.latest) or text
        return _word(event.status), brief(text) if action is None else text

    def _again(self, event: AttemptEnded) -> tuple[str, str]:
        """Return the words for an attempt that another one follows."""
        action = self.state.action(event.node)
        goal = action.goals.get(event.goal_id)
        if goal is None:  # an event of the goal is damaged
            return "", ""
        told = f"attempt {event.attempt} of {action.of}: {attempt_text(action, goal)}"
        return "goal", f"{told}; again in {event.again_in:.1f} s"

    def _goal(self, event: GoalChanged) -> str:
        """Return the text for a goal that is sent, or that has ended after its leaf had left it."""
        action, story = self.state.action(event.node), self.state.nodes[event.node]
        goal = action.goals[event.goal_id]
        if event.state == "SENDING":
            waited = event.at.steady - goal.began.steady
            late = f", after {waited:.1f} s in which the goal waited" if waited >= WAITED else ""
            sent = f": {shorten(opened(event.goal))}" if event.goal is not None else ""
            tries = f", attempt {event.attempt} of {action.of}" if event.attempt > 1 else ""
            return f"sent to {event.server}{tries}{late}{sent}"
        is_left = goal is not action.latest or (
            story.status is not Status.RUNNING and goal.began.number < story.number
        )
        if event.state != DONE or not is_left:
            return ""
        end = f"ended {event.end}" if event.end is not None else "is left"
        return f"the goal that was left {end}{f': {event.reason}' if event.reason else ''}"


def _judged(action: ActionStory, goal: GoalStory) -> str:
    """Return the words for the last attempt of a visit; "" where its leaf never got that far."""
    if goal.outcome is None:
        return ""
    of = f" (attempt {action.attempt} of {action.of})" if action.attempt > 1 else ""
    if goal.outcome is Outcome.SUCCEEDED and goal.result is not None:
        return f"{goal.outcome}{of}: {shorten(opened(goal.result))}"
    return f"{attempt_text(action, goal)}{of}"


def _word(status: Status) -> str:
    return "STOPPED" if status is Status.INVALID else status.value


def _bared(item: Item) -> Item | None:
    return stripped(item) if isinstance(item, State) else bare(item)
