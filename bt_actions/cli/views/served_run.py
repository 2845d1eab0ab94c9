"""A run at a server of trees, shown as if it were here; and why the server rejected it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bt_actions.cli.exits import Exit
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.one_goal import GoalView
from bt_actions.cli.views.table import columns
from bt_actions.cli.views.words import Closing, brief
from bt_actions.running.report import Row
from bt_actions.utilities.places import told_apart
from bt_actions.utilities.plain_text import clean

_NOT_NOW = ("BUSY", "INACTIVE")
"""Codes of rejections that say nothing against the tree or its inputs."""


def rejection(goal_name: str) -> tuple[Exit, str]:
    """Ask why the server rejected a goal: whether what was asked for is wrong, and in words."""
    from bt_actions.serving.client import why_rejected

    why = why_rejected(goal_name)
    if why is None:
        return Exit.FAILURE, "the server rejected the goal: why is in its log"
    code = Exit.FAILURE if why.code in _NOT_NOW else Exit.BAD_INPUT
    return code, clean(f"{why.code}: {why.message}")


class CallView(GoalView):
    """Which leaves run there, a line a change; at the end what `run` says of a run here."""

    def feedback_text(self, row: Row) -> str:
        """Return the running leaves, deepest first."""
        message = self._leaf.progress().feedback
        if message is None:
            return ""
        running = ", ".join(_leaf_text(each) for each in message.running)
        state = "waits for its turn" if message.waiting else "paused" if message.paused else ""
        return ": ".join(filter(None, [state, running]))

    def result_lines(self) -> list[str]:
        """Return the table of the run's actions, its outputs, and why it failed."""
        result = self._leaf.result
        if result is None:
            return []
        actions = [_action(each) for each in result.actions]
        names = told_apart(tuple(each["path"].split(" / ")) for each in actions)
        body = [
            (
                names[tuple(each["path"].split(" / "))],
                str(each["server"]),
                str(each["attempts"]),
                str(each["outcome"]),
                f"{each['duration']:.2f} s",
            )
            for each in actions
        ]
        lines = ["", *columns(body)] if body else []
        outputs = [clean(f"{name}: {brief(value)}") for name, value in _outputs(result).items()]
        lines += ["", *outputs] if outputs else []
        said = [clean(line) for line in result.error_msg.splitlines()]
        return [*lines, "", *said] if said else lines


class CallJsonView(JsonView):
    """The objects of `run --json`; outputs and actions are those of the run there."""

    rejection: Callable[[], tuple[Exit, str] | None]

    def _finished(self, closing: Closing) -> dict[str, object]:
        finished = super()._finished(closing)
        leaf: Any = self._report.root
        if leaf.result is not None:
            finished["outputs"] = _outputs(leaf.result)
            finished["actions"] = [_action(each) for each in leaf.result.actions]
            finished["error_code"] = leaf.result.error_code
        if closing.exit_code is Exit.FAILURE and (rejected := self.rejection()):
            finished["exit_code"], finished["error"] = int(rejected[0]), rejected[1]
        return finished


def _leaf_text(leaf: Any) -> str:
    attempt = f" (attempt {leaf.attempt} of {leaf.attempts})" if leaf.attempt > 1 else ""
    return clean(f"{leaf.path}{attempt}{f': {leaf.message}' if leaf.message else ''}")


def _outputs(result: Any) -> dict[str, object]:
    from bt_actions.behaviours.run_tree import roots_of

    try:
        outputs = roots_of(result)["outputs"]
    except ValueError:
        return {}
    assert isinstance(outputs, dict)
    return outputs


def _action(report: Any) -> dict[str, Any]:
    """An ActionReport as `run --json` has it."""
    from bt_actions.serving.outcome import ENDS, OUTCOMES

    outcomes = {number: str(outcome) for outcome, number in OUTCOMES.items()}
    ends = {number: str(end) for end, number in ENDS.items()}
    return {
        "path": clean(report.path),
        "server": clean(report.server),
        "attempts": report.attempts,
        "outcome": outcomes.get(report.outcome),
        "end": ends.get(report.end),
        "reason": clean(report.reason),
        "duration": round(report.duration.sec + report.duration.nanosec / 1e9, 3),
        "place": clean(report.place) or None,
    }
