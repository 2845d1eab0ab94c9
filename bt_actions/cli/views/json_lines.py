"""A run for programs: one JSON object a line, the result last."""

from __future__ import annotations

from typing import TextIO
from uuid import UUID

from py_trees.behaviour import Behaviour

from bt_actions.cli.views.words import Closing, outputs_of
from bt_actions.document import tree_name
from bt_actions.events import Event, GoalChanged, NodeChanged, TreeStarted
from bt_actions.render import kind, rows
from bt_actions.running.report import Report, Row, place_of
from bt_actions.utilities.plain_text import as_json


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
                    "name": row.path[-1],
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
            "name": row.path[-1],
            "path": list(row.path),
            "server": row.server,
            "attempts": row.attempts,
            "outcome": row.outcome,
            "end": row.end,
            "reason": row.reason,
            "duration": round(row.seconds(self._report.now), 3),
            "place": row.place or None,
        }

    def _write(self, data: dict[str, object]) -> None:
        line = as_json(data, ascii_only=not _is_utf8(self._out))
        self._out.write(line + "\n")
        self._out.flush()


def _is_utf8(stream: TextIO) -> bool:
    return (stream.encoding or "").lower().replace("-", "") == "utf8"
