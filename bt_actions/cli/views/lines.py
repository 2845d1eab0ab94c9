"""A run as lines, for a pipe; or silent until its end."""

from __future__ import annotations

from typing import TextIO

from py_trees.common import Status

from bt_actions.cli.views.view import View
from bt_actions.events import AttemptEnded, Event, GoalChanged, NodeChanged, RoundBegan, TickLasts
from bt_actions.events.kinds import LEFT_OUT
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import DONE, ActionStory
from bt_actions.story.doing import doing
from bt_actions.story.state import OVER, NodeStory, State
from bt_actions.story.values import round_text
from bt_actions.story.why import attempt_text
from bt_actions.story.words import goal_text, last_words, troubles
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import fit

LASTING = 1.0
"""Seconds after which a waiting goal, or one that is being canceled, gets a line."""


class LineView(View):
    """A line for each change of a node, each goal under way, and each failed attempt.

    A goal that waits, is sent or is canceled gets a line when that lasts; a goal whose end comes
    after its outcome gets a line at its end. Each round of a loop tells its nodes again.
    """

    def __init__(self, state: State, out: TextIO, *, verbose: bool = False) -> None:
        """Take the output; `verbose` adds a line for every other state of a goal, at once."""
        self._state = state
        self._out = out
        self._verbose = verbose
        self._nodes: dict[int, Status] = {}
        """The status in each node's last line."""
        self._passing: dict[int, float] = {}
        """The moments since which leaves' goals are in a state that is told only when it lasts."""

    def event(self, event: Event) -> None:
        """Write a line where `event` changes an earlier line."""
        match event:
            case NodeChanged():
                self._node(event)
            case TickLasts():
                said = str(doing(self._state, self._state.nodes[event.node], event.at.steady))
                over = f"its tick has taken {event.seconds:.1f} s" if event.is_over else ""
                self._line(event.at.steady, "tick", event.node, over or said)
            case GoalChanged():
                self._goal(event)
            case AttemptEnded():
                self._attempt(event)
            case RoundBegan():
                for node in self._state.below(event.node):
                    self._nodes.pop(node, None)
                self._line(event.at.steady, "round", event.node, round_text(event))

    def due(self, now: float) -> None:
        """Write a line for each state that has lasted long enough."""
        for key, since in list(self._passing.items()):
            if now - since >= LASTING and key in self._state.nodes:
                at, action = self._passing.pop(key) + LASTING, self._state.action(key)
                does = doing(self._state, self._state.nodes[key], at)
                self._line(at, "goal", key, goal_text(action) if action.outcome else str(does))

    def _node(self, event: NodeChanged) -> None:
        story = self._state.nodes[event.node]
        if event.status is Status.SUCCESS:
            self._passing.pop(event.node, None)
        told = OVER if story.node.server else (Status.RUNNING, *OVER)  # its goal tells of RUNNING
        if event.status not in told or self._nodes.get(event.node) is event.status:
            if event.status is Status.INVALID:
                self._nodes.pop(event.node, None)
            return
        self._nodes[event.node] = event.status
        if event.is_left_out:
            self._line(event.at.steady, LEFT_OUT, event.node, event.why_left_out)
            return
        self._line(event.at.steady, event.status.value, event.node, self._news(story, event))

    def _news(self, story: NodeStory, event: NodeChanged) -> str:
        """Return the news of a node that no line has told, of its attempt or of a child."""
        said = event.message
        if event.status is Status.RUNNING:
            return str(doing(self._state, story, event.at.steady)._replace(since="", tries=""))
        if said == Outcome.SUCCEEDED or said in [
            self._state.nodes[each].message for each in story.children
        ]:
            return ""
        if event.status is Status.FAILURE and self._state.acts(event.node):
            return said.removesuffix(f": {self._state.action(event.node).reason}")
        return said

    def _goal(self, event: GoalChanged) -> None:
        key, action = event.node, self._state.action(event.node)
        self._passing.pop(key, None)
        if event.outcome is Outcome.SUCCEEDED:
            return  # the leaf's line tells it
        is_over = event.outcome is not None
        if is_over and (event.state == DONE or event.end is not End.UNKNOWN):
            if action.goals[event.goal_id].verdict is not None:  # else a verdict follows
                end = "end not known" if event.end is End.UNKNOWN else f"ended {event.end}"
                self._line(event.at.steady, "goal", key, f"{_which(action, event)}{end}")
        elif not is_over and (self._verbose or event.state == "EXECUTING"):
            self._line(event.at.steady, "goal", key, goal_text(action))
        else:
            self._passing[key] = event.at.steady

    def _attempt(self, event: AttemptEnded) -> None:
        action = self._state.action(event.node)
        goal = action.goals.get(event.goal_id)  # None where its events are damaged
        if event.outcome is not Outcome.SUCCEEDED and goal is not None:
            text = _which(action, event) + attempt_text(action, goal)
            again = f"; again in {event.again_in:.1f} s" if event.again_in else ""
            self._line(event.at.steady, "goal", event.node, text + again)

    def finish(self) -> None:
        """Write the table of actions, the world's verdict and the summary."""
        for line in last_words(self._state):
            self.say(line)

    def _line(self, at: float, what: str, node: int, said: str) -> None:
        text = clean(": ".join(filter(None, [" / ".join(self._state.path(node)), said])))
        self.say(f"{max(0.0, at - self._state.started):8.2f} s  {what:<8} {text}")

    def say(self, text: str) -> None:
        """Write `text` on a line of its own."""
        self._out.write(f"{fit(text)}\n")
        self._out.flush()


def _which(action: ActionStory, event: GoalChanged | AttemptEnded) -> str:
    return f"attempt {event.attempt} of {action.of}: " if action.of > 1 else ""


class QuietView(View):
    """Silence until the end."""

    def __init__(self, state: State, out: TextIO) -> None:
        self._state = state
        self._out = out

    def finish(self) -> None:
        """Write what went wrong, if anything did."""
        for line in troubles(self._state):
            self._out.write(f"{line}\n")
        self._out.flush()
