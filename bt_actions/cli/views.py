"""Ways to watch a run: lines for a pipe, JSON objects for a program. The live view is live.py.

A view is told every event after the report has taken it in, on the main thread. It only writes;
it decides nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TextIO
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.cli.words import Closing, goal_text, last_words, outputs_of, troubles
from bt_actions.goals.policy import End, Outcome
from bt_actions.render import action_of, kind, rows
from bt_actions.running.report import DONE, Report, Row, place_of
from bt_actions.utilities.plain_text import as_json, clean

if TYPE_CHECKING:
    from bt_actions.events import Event, GoalChanged

LASTING = 1.0
"""Seconds after which a goal that still waits, or is still being canceled, gets a line."""


class View(Protocol):
    """What watches a run."""

    @property
    def fileno(self) -> int:
        """A file descriptor whose data the view passes on at its next frame, or -1."""

    def event(self, event: Event) -> None:
        """Show one event."""

    def frame(self) -> None:
        """Show what changes without an event; called about ten times a second."""

    def say(self, text: str) -> None:
        """Tell the user something about the run itself."""

    def finish(self, closing: Closing) -> None:
        """Show how it ended; nothing is shown after it."""

    def close(self) -> None:
        """Give the terminal back, whether or not `finish` was called; may be called twice."""


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
        from bt_actions.events import GoalChanged, NodeChanged, TreeFinished

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
        self._out.write(f"{line}\n")
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


class JsonView:
    """One JSON object a line; the last has `"event": "finished"`."""

    fileno = -1

    def __init__(self, report: Report, out: TextIO) -> None:
        self._report = report
        self._out = out
        self._ids: dict[UUID, int] = {}
        for row in rows(report.root):
            self._id(row.node)

    def event(self, event: Event) -> None:
        """Write `event` as an object."""
        from bt_actions.document import tree_name
        from bt_actions.events import GoalChanged, NodeChanged, TreeStarted

        time = round(event.time - self._report.started, 4)
        if isinstance(event, TreeStarted):
            root = self._report.root
            nodes = [self._node(row.node) for row in rows(root)]
            self._write({"event": "started", "tree": tree_name(root), "nodes": nodes})
        elif isinstance(event, NodeChanged):
            self._write(
                {
                    "event": "node",
                    "time": time,
                    "id": self._id(event.node),
                    "path": list(event.path),
                    "status": event.status.value,
                    "message": event.message,
                    "place": place_of(event.node) or None,
                }
            )
        elif isinstance(event, GoalChanged):
            row = self._report.row(event.behaviour)
            self._write(
                {
                    "event": "goal",
                    "time": time,
                    "id": self._id(event.behaviour),
                    "name": row.name,
                    "path": list(row.path),
                    "server": row.server,
                    "goal_id": event.goal_id,
                    "attempt": event.attempt,
                    "state": event.state,
                    "outcome": event.outcome,
                    "end": event.end,
                    "reason": event.reason,
                }
            )

    def frame(self) -> None:
        """Nothing changes without an event."""

    def say(self, text: str) -> None:
        """Write `text` as a note."""
        self._write({"event": "note", "text": text})

    def finish(self, closing: Closing) -> None:
        """Write the last object."""
        self._write(self._finished(closing))

    def _finished(self, closing: Closing) -> dict[str, object]:
        from bt_actions.messages.conversion import to_plain

        report = self._report
        return {
            "event": "finished",
            "status": report.status.value,
            "exit_code": int(closing.exit_code),
            "cause": closing.cause or None,
            "error": closing.error or None,
            "duration": round(report.now - report.started, 3),
            "outputs": {name: to_plain(value) for name, value in outputs_of(report).items()},
            "actions": [self._action(row) for row in report.rows],
            "failures": [
                {
                    "id": self._id(culprit.node),
                    "path": list(culprit.path),
                    "attempts": culprit.row.attempt if culprit.row else 0,
                    "outcome": culprit.row.outcome if culprit.row else None,
                    "reason": (culprit.row.reason if culprit.row else "") or culprit.message,
                    "place": culprit.place or None,
                }
                for culprit in report.culprits()
            ],
            "warnings": [
                {
                    "id": self._id(warned.node),
                    "path": list(warned.path),
                    "message": warned.message,
                    "place": warned.place or None,
                }
                for warned in report.warnings
            ],
            "unaccounted": report.unaccounted,
            "servers_gone": report.servers_gone,
            "world": closing.verdict or None,
            "complaint": closing.complaint or None,
        }

    def close(self) -> None:
        """Nothing to give back."""

    def _id(self, node: Behaviour) -> int:
        """Return the number of a node: from 1, parents first; what is inserted later follows."""
        return self._ids.setdefault(node.id, len(self._ids) + 1)

    def _node(self, node: Behaviour) -> dict[str, object]:
        return {
            "id": self._id(node),
            "parent": None if node.parent is None else self._id(node.parent),
            "name": node.name,
            "kind": kind(node),
            "place": place_of(node) or None,
        }

    def _action(self, row: Row) -> dict[str, object]:
        return {
            "id": self._id(row.behaviour),
            "name": row.name,
            "path": list(row.path),
            "server": row.server,
            "attempts": row.attempts,
            "outcome": row.outcome,
            "end": row.end,
            "reason": row.reason,
            "duration": round(self._report.seconds(row), 3),
            "place": row.place or None,
        }

    def _write(self, data: dict[str, object]) -> None:
        line = as_json(data, ascii_only=not _is_utf8(self._out))
        self._out.write(line + "\n")
        self._out.flush()


def _is_utf8(stream: TextIO) -> bool:
    return (stream.encoding or "").lower().replace("-", "") == "utf8"
