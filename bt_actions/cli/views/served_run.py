"""A run at a server of trees, shown like a run here; and the reason of a rejection."""

from __future__ import annotations

import json
from typing import Any

from bt_actions.cli.exits import Exit
from bt_actions.cli.views.json_lines import JsonView, action_data, plain
from bt_actions.cli.views.one_goal import GoalView
from bt_actions.events import Node, Value
from bt_actions.story.actions import ActionStory
from bt_actions.story.table import table
from bt_actions.story.values import opened
from bt_actions.story.words import blocks, outputs_lines
from bt_actions.utilities.names import told_apart
from bt_actions.utilities.plain_text import clean

_NOT_NOW = ("BUSY", "INACTIVE")
"""Codes of rejections that are no fault of the tree or its inputs."""


def rejection(goal_name: str) -> tuple[Exit, str]:
    """Ask for the reason of a rejection: return an exit code for the request, and words."""
    from bt_actions.serving.client import why_rejected

    why = why_rejected(goal_name)
    if why is None:
        return Exit.FAILURE, "the server rejected the goal: why is in its log"
    code = Exit.FAILURE if why.code in _NOT_NOW else Exit.BAD_INPUT
    return code, clean(f"{why.code}: {why.message}")


class CallView(GoalView):
    """The running leaves there, a line a change; at the end the lines of a `run` here."""

    def feedback_text(self, action: ActionStory) -> str:
        """Return the running leaves, deepest first."""
        came = action.latest.feedback if action.latest is not None else None
        if came is None:
            return ""
        message = opened(came.feedback)
        running = ", ".join(_leaf_text(each) for each in _listed(message.get("running")))
        waits, paused = message.get("waiting"), message.get("paused")
        state = "waits for its turn" if waits else "paused" if paused else ""
        return ": ".join(filter(None, [state, running]))

    def result_lines(self, action: ActionStory) -> list[str]:
        """Return the table of the run's actions, its outputs, and why it failed."""
        result = _result(action)
        if not result:
            return []
        actions = _actions(result)
        names = told_apart(each.path for each in actions)
        rows = table(actions, lambda each: names[each.path], 0.0)
        said = [clean(line) for line in str(result.get("error_msg", "")).splitlines()]
        return blocks(rows, outputs_lines(_outputs(result)), said)


class CallJsonView(JsonView):
    """The objects of `run --json`; outputs and actions are those of the run there."""

    def _finished(self) -> dict[str, object]:
        finished = super()._finished()
        for result in filter(None, map(_result, self._state.actions)):
            finished["outputs"] = _outputs(result)
            finished["actions"] = [action_data(each, 0.0) for each in _actions(result)]
            finished["error_code"] = result.get("error_code")
        return finished


def _result(action: ActionStory) -> dict[str, Value]:
    return opened(action.latest.result) if action.latest is not None else {}


def _listed(value: Value) -> list[dict[str, Any]]:
    """Return the messages of a list."""
    return [plain(each) for each in value] if isinstance(value, tuple) else []


def _leaf_text(leaf: dict[str, Any]) -> str:
    return clean(": ".join(filter(None, (leaf["path"], leaf["message"]))))


def _outputs(result: dict[str, Value]) -> dict[str, object]:
    try:
        outputs = json.loads(str(result.get("outputs") or "{}"))
    except (ValueError, RecursionError):
        return {}
    return outputs if isinstance(outputs, dict) else {}


def _actions(result: dict[str, Value]) -> list[ActionStory]:
    """Return the ActionReports of a result as stories of actions."""
    from bt_actions.serving.outcome import ENDS, OUTCOMES, SEPARATOR

    outcomes = {number: outcome for outcome, number in OUTCOMES.items()}
    ends = {number: end for end, number in ENDS.items()}
    found = []
    for number, report in enumerate(_listed(result.get("actions")), 1):
        path = tuple(clean(report["path"]).split(SEPARATOR))
        node = Node(number, None, path[-1], "action", clean(report["place"]))
        duration = report["duration"]
        seconds = duration["sec"] + duration["nanosec"] / 1e9
        found.append(
            ActionStory(
                node,
                path,
                clean(report["server"]),
                attempts=report["attempts"],
                outcome=outcomes.get(report["outcome"]),
                end=ends.get(report["end"]),
                reason=clean(report["reason"]),
                counted=seconds,
                duration=seconds,
            )
        )
    return found
