"""A run for programs: one JSON object a line, the result last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TextIO

from py_trees.common import Status

from bt_actions.cli.views.view import View
from bt_actions.events import (
    AttemptEnded,
    Cut,
    Event,
    GoalChanged,
    Node,
    NodeChanged,
    RoundBegan,
    RunBegan,
    TickLasts,
    Value,
)
from bt_actions.events.kinds import FeedbackCame
from bt_actions.story.actions import ActionStory
from bt_actions.story.failures import Failure
from bt_actions.story.state import State
from bt_actions.story.why import why
from bt_actions.story.words import NO_END
from bt_actions.utilities.plain_text import as_json

KINDS = {
    NodeChanged: "node",
    TickLasts: "tick",
    RoundBegan: "round",
    GoalChanged: "goal",
    FeedbackCame: "feedback",
    AttemptEnded: "attempt",
}
"""The events of a node that are written, with their names in `event`."""


class JsonView(View):
    """One JSON object a line; the last has `"event": "finished"`."""

    def __init__(self, state: State, out: TextIO) -> None:
        self._state = state
        self._out = out

    def event(self, event: Event) -> None:
        """Write an event as an object, where objects of its kind are written."""
        match event:
            case RunBegan():
                self._write(
                    {
                        "event": "started",
                        "tree": event.tree,
                        "run": event.run_id,
                        "wall": event.at.wall,
                        "where": dict(event.where),
                        "inputs": plain(event.inputs),
                        "nodes": [_node(node) for node in event.nodes],
                    }
                )
            case _ if type(event) in KINDS:
                self._of_node(event)

    def say(self, text: str) -> None:
        """Write `text` as a note."""
        self._write({"event": "note", "text": text})

    def finish(self) -> None:
        """Write the last object."""
        self._write(self._finished())

    def _finished(self) -> dict[str, object]:
        state = self._state
        ended, finished = state.ended or NO_END, state.finished
        error = (finished is not None and finished.error) or ended.error
        return {
            "event": "finished",
            "status": state.status.value,
            "exit_code": ended.exit_code if state.ended is not None else None,
            "cause": ended.cause or None,
            "error": error or None,
            "duration": round(state.elapsed, 3),
            "outputs": plain(state.outputs),
            "actions": [action_data(each, state.latest) for each in state.actions],
            "failures": [self._failure(each) for each in state.failures],
            "why": why(state),
            "dealt_with": [
                self._failure(each) | {"by": each.by.id if each.by is not None else None}
                for each in state.dealt_with
            ],
            "warnings": [
                {
                    "id": each.node.id,
                    "path": list(each.path),
                    "message": each.message,
                    "place": each.node.place or None,
                }
                for each in state.warnings
            ],
            "unaccounted": list(ended.unaccounted),
            "servers_gone": state.servers_gone,
            "world": ended.world or None,
            "complaint": ended.complaint or None,
        }

    def _of_node(self, event: Any) -> None:
        """Write an event of one node, with all its values."""
        has = {each.name: plain(getattr(event, each.name)) for each in fields(event)[1:]}
        node = has.pop("node")
        about = {
            "event": KINDS[type(event)],
            "time": round(event.at.steady - self._state.started, 4),
            "wall": event.at.wall,
            "id": node,
            "path": list(self._state.path(node)),
        }
        self._write(about | has | {"place": self._state.nodes[node].node.place or None})

    def _failure(self, failure: Failure) -> dict[str, object]:
        action = failure.action
        latest = failure.attempts[-1] if failure.attempts else None
        return {
            "id": failure.node.id,
            "path": list(failure.path),
            "attempts": len(failure.attempts),
            "outcome": latest.outcome if latest is not None else None,
            "reason": (latest.reason if latest is not None else "") or failure.message,
            "place": failure.place or None,
            "server": action.server if action is not None else None,
            "goal": plain(latest.goal) if latest is not None else None,
            "result": plain(latest.result) if latest is not None else None,
            "items": [
                {"id": loop.id, "round": begun.number, "item": plain(begun.item)}
                for loop, begun in failure.items
            ],
        }

    def _write(self, data: dict[str, object]) -> None:
        encoding = (self._out.encoding or "").lower().replace("-", "")
        line = as_json(data, ascii_only=encoding != "utf8")
        self._out.write(line + "\n")
        self._out.flush()


def action_data(action: ActionStory, now: float) -> dict[str, object]:
    """Return the story of an action, as of `now` on the steady clock."""
    return {
        "id": action.node.id,
        "name": action.node.name,
        "path": list(action.path),
        "server": action.server,
        "attempts": action.attempts,
        "visits": action.visits,
        "outcome": action.outcome,
        "end": action.end,
        "reason": action.reason,
        "duration": round(action.seconds(now), 3),
        "place": action.node.place or None,
    }


def plain(value: Value | Mapping[str, Value] | Status) -> Any:
    """Return a snapshot in JSON: bytes as numbers, and the beginning of a cut value."""
    if isinstance(value, Status):
        return value.value
    if isinstance(value, Cut):
        return plain(value.head)
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, tuple | bytes):
        return [plain(item) for item in value]
    return value


def _node(node: Node) -> dict[str, object]:
    told = {key: getattr(node, key) for key in ("id", "parent", "name", "kind")}
    return told | {"place": node.place or None}
