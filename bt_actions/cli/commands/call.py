"""`bt-actions call TREE`: a tree of a server of trees, run as `run` runs a file.

It is a tree of one RunTree leaf, so that the goal has the same life, deadlines and end as in any
tree. What the server tells at the end is shown as if the tree had run here.
"""

from __future__ import annotations

import argparse
import sys
import uuid
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bt_actions.cli.arguments.options import add_option
from bt_actions.cli.arguments.ros_arguments import add_ros_args, parameters
from bt_actions.cli.arguments.values import goal_fields, nested
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import note
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.lines import QuietView
from bt_actions.cli.views.one_goal import GoalView
from bt_actions.utilities.plain_text import clean

if TYPE_CHECKING:
    from bt_actions.behaviours.run_tree import RunTree
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.cli.views.view import View
    from bt_actions.cli.views.words import Closing
    from bt_actions.running.report import Row

_EPILOG = """\
examples:
  bt-actions call pick_and_place
  bt-actions call pick_and_place --set place_at=4.5 --namespace /r1 --timeout 60
  bt-actions call patrol --server /r2/run_tree --json

`bt-actions list` shows which trees there are. Ctrl-C cancels the run and waits for its end. Exit
codes are those of `run`: 2 where the server knows no such tree or refuses its inputs, 3 where it
does not account for every goal of the run, and 1 also where it is busy, is not in sight within 5 s,
or goes away meanwhile: then the next `serve` there cancels what it left.
"""
_NOT_NOW = ("BUSY", "INACTIVE")
"""Codes of rejections that say nothing against the tree or its inputs."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "call",
        help="have a server of trees run one",
        description="Have a server of trees (`bt-actions serve`) run a tree; show how it goes.",
        epilog=_EPILOG,
    )
    parser.add_argument("tree", metavar="TREE", help="name of the tree at the server")
    add_option(parser, "--set")
    parser.add_argument(
        "--server", metavar="NAME", default="run_tree", help="its action; run_tree if not given"
    )
    add_option(parser, "--namespace", help="namespace of the server")
    add_option(parser, "--timeout")
    add_option(parser, "--json")
    add_option(parser, "--quiet")
    add_ros_args(parser, "; parameters (-p NAME:=VALUE) give inputs their values as of `run`")


def run(args: argparse.Namespace) -> int:
    """Have the tree run, and see the goal to its end."""
    if args.json:
        from bt_actions.cli.streams.results import keep_results_apart

        keep_results_apart()
    goal_name = f"bt-actions call {uuid.uuid4().hex[:12]}"
    inputs = nested(parameters(args.ros_args, args.namespace)) | goal_fields(args.set, "--set")
    leaf = _leaf(args.tree, args.server, inputs, goal_name)
    rejection = Rejected(leaf, goal_name)

    from bt_actions.cli.driving.session import Session

    with Session(leaf, namespace=args.namespace) as session:
        view: View = CallView(session.report, leaf, sys.stdout, feedback=True)
        if args.json:
            view = as_json = session.json_view(CallJsonView)
            as_json.rejection = rejection
        elif args.quiet:
            view = QuietView(session.report, sys.stdout)
        code = session.run(view, timeout=args.timeout)
    if code is not Exit.FAILURE or not rejection.happened:
        return code
    note(f"bt-actions call: {rejection.text}")
    return rejection.exit_code


def _leaf(tree: str, server: str, inputs: dict[str, object], goal_name: str) -> RunTree:
    """Check what can be checked without a server."""
    from bt_actions.behaviours.run_tree import RunTree, inputs_text
    from bt_actions.document.language.ros_names import why_not

    if why := why_not(server):
        raise BadInput(f"--server: {server!r} cannot be the name of an action: {why}")
    try:
        inputs_text(inputs)
    except ValueError as error:
        raise BadInput(f"--set: {error}") from error
    return RunTree(tree, tree, inputs, server=server, goal_name=goal_name)


class Rejected:
    """Why the server rejected the goal, if it did; asked once, when somebody wants to know."""

    def __init__(self, leaf: RunTree, goal_name: str) -> None:
        self._leaf = leaf
        self._goal_name = goal_name

    @property
    def happened(self) -> bool:
        """Whether it did."""
        from bt_actions.goals.policy import Outcome

        return self._leaf.outcome is Outcome.REJECTED

    @cached_property
    def _why(self) -> tuple[str, str] | None:
        from bt_actions.serving.asking import why_rejected

        why = why_rejected(self._goal_name)
        return None if why is None else (clean(why.code), clean(why.message))

    @property
    def text(self) -> str:
        """Code and reason."""
        return ": ".join(self._why or ("the server rejected the goal", "why is in its log"))

    @property
    def exit_code(self) -> Exit:
        """Whether something is wrong with what was asked for."""
        wrong = self._why is not None and self._why[0] not in _NOT_NOW
        return Exit.BAD_INPUT if wrong else Exit.FAILURE


class CallView(GoalView):
    """Which leaves run there, a line a change; at the end what `run` says of a run here."""

    def feedback_text(self, row: Row) -> str:
        """Return the running leaves, deepest first."""
        message = self._leaf.progress().feedback
        if message is None:
            return ""
        return ", ".join(_leaf_text(each) for each in message.running)

    def result_lines(self) -> list[str]:
        """Return the table of the run's actions, its outputs, and why it failed."""
        from bt_actions.cli.views.table import columns
        from bt_actions.cli.views.words import brief

        result = self._leaf.result
        if result is None:
            return []
        actions = [_action(each) for each in result.actions]
        body = [
            (
                str(each["path"]).rpartition(" / ")[2],
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

    rejection: Rejected

    def _finished(self, closing: Closing) -> dict[str, object]:
        finished = super()._finished(closing)
        leaf: Any = self._report.root
        if leaf.result is not None:
            finished["outputs"] = _outputs(leaf.result)
            finished["actions"] = [_action(each) for each in leaf.result.actions]
            finished["error_code"] = leaf.result.error_code
        if closing.exit_code is Exit.FAILURE and self.rejection.happened:
            finished["exit_code"] = int(self.rejection.exit_code)
            finished["error"] = self.rejection.text
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
