"""A run as lines, for a pipe; or without a word until its end."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TextIO

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.cli.views.words import Closing, goal_text, last_words, troubles
from bt_actions.events import Event, GoalChanged, NodeChanged, TreeFinished
from bt_actions.goals.policy import End, Outcome
from bt_actions.render import action_of
from bt_actions.running.report import DONE, Report, Row
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import fit

LASTING = 1.0
"""Seconds after which a goal that still waits, or is still being canceled, gets a line."""


class LineView:
    """One line a change of a node, one for a goal that is under way and one for how it ended.

    The lines of a goal come after the news of the tick in which it was sent. A goal that waits, is
    sent or is canceled gets a line when that lasts.
    """

    fileno = -1

    def __init__(
        self,
        report: Report,
        out: TextIO,
        *,
        verbose: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`verbose` adds a line for every other state of a goal, at once."""
        self._report = report
        self._out = out
        self._verbose = verbose
        self._clock = clock
        self._shown: dict[object, object] = {}
        self._held: dict[object, list[tuple[Row, str]]] = {}
        """By leaf: what happened before the news of its tick."""
        self._passing: dict[object, tuple[float, Row, str]] = {}
        """By leaf: since when its goal is in a state that is only told when it lasts."""

    def event(self, event: Event) -> None:
        """Write a line when `event` changes what was written before."""
        if isinstance(event, NodeChanged):
            if event.status in self._told_of(event.node):
                told = "" if event.message in ("", Outcome.SUCCEEDED) else f": {event.message}"
                if not event.node.children:
                    self._release(event.node.id, event.status)
                self._line(event.status.value, " / ".join(event.path) + told)
            else:
                self._release(event.node.id, event.status)
        elif isinstance(event, GoalChanged):
            self._goal(event)
        elif isinstance(event, TreeFinished):
            self._release_all()

    def frame(self) -> None:
        """Write what has waited long enough."""
        self._release_all()
        now = self._clock()
        for key, (since, row, text) in list(self._passing.items()):
            if now - since >= LASTING:
                del self._passing[key]
                self._goal_line(row, text)

    def _goal(self, event: GoalChanged) -> None:
        row = self._report.row(event.behaviour)
        key = event.behaviour.id
        change = (row.attempts, event.state, event.outcome, event.end)
        if event.outcome is Outcome.SUCCEEDED or self._shown.get(key) == change:
            self._passing.pop(key, None)
            return  # a success is told by the leaf's
        self._shown[key] = change
        text = goal_text(row)
        self._passing.pop(key, None)
        if not self._verbose and not self._is_told(event):
            self._passing[key] = (self._clock(), row, text)
        elif self._report.status_of(row.behaviour) is Status.RUNNING or not row.live:
            self._goal_line(row, text)
        else:
            self._held.setdefault(key, []).append((row, text))

    def _is_told(self, event: GoalChanged) -> bool:
        """Whether a goal's state is worth a line however short it lasts."""
        if event.outcome is None:
            return event.state == "EXECUTING"
        return event.state == DONE or event.end is not End.UNKNOWN

    def _release(self, key: object, status: Status) -> None:
        """Write the lines of a leaf that were held back; `status` is the leaf's."""
        for row, text in self._held.pop(key, ()):
            self._goal_line(row, text)
        if status is Status.SUCCESS:
            self._passing.pop(key, None)

    def _release_all(self) -> None:
        for key in list(self._held):
            self._release(key, Status.RUNNING)

    def _goal_line(self, row: Row, text: str) -> None:
        self._line("goal", f"{' / '.join(row.path)}: {text}")

    def say(self, text: str) -> None:
        """Write `text` on a line of its own."""
        self._write(text)

    def finish(self, closing: Closing) -> None:
        """Write the table of actions, the world's verdict and the summary."""
        self._release_all()
        for line in last_words(self._report, closing):
            self._write(line)

    def close(self) -> None:
        """Nothing to give back."""

    def _told_of(self, node: Behaviour) -> tuple[Status, ...]:
        """The statuses worth a line; what runs in an action, its goal tells."""
        ends = (Status.SUCCESS, Status.FAILURE)
        return ends if action_of(node) else (Status.RUNNING, *ends)

    def _line(self, what: str, text: str) -> None:
        self._write(f"{self._report.now - self._report.started:8.2f} s  {what:<8} {clean(text)}")

    def _write(self, line: str) -> None:
        self._out.write(f"{fit(line)}\n")
        self._out.flush()


class QuietView:
    """Says nothing until the end."""

    fileno = -1

    def __init__(self, report: Report, out: TextIO) -> None:
        self._report = report
        self._out = out

    def event(self, event: Event) -> None:
        """Show nothing."""

    def frame(self) -> None:
        """Show nothing."""

    def say(self, text: str) -> None:
        """Show nothing."""

    def finish(self, closing: Closing) -> None:
        """Write what went wrong, if anything did."""
        for line in troubles(self._report, closing):
            self._out.write(f"{line}\n")
        self._out.flush()

    def close(self) -> None:
        """Nothing to give back."""
