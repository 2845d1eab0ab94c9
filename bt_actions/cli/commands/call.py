"""`bt-actions call TREE`: a tree of a server of trees, run as `run` runs a file.

The command runs a tree of one RunTree leaf, so the goal has the same life, deadlines and end as in
any tree. The server's last words are shown as if the tree had run here.
"""

from __future__ import annotations

import argparse
import os
import sys
import uuid
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import action_name, add_option
from bt_actions.cli.arguments.ros_arguments import add_ros_args, parameters
from bt_actions.cli.arguments.values import goal_fields, nested
from bt_actions.cli.driving.record import add_options, recorder
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.results import keep_results_apart
from bt_actions.cli.streams.writing import note

if TYPE_CHECKING:
    from bt_actions.behaviours.run_tree import RunTree
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.cli.views.view import View

_EPILOG = """\
examples:
  bt-actions call pick_and_place
  bt-actions call pick_and_place --set place_at=4.5 --namespace /r1 --timeout 60
  bt-actions call patrol --server /r2/run_tree --json

`bt-actions list` lists the trees. Ctrl-C cancels the run and waits for its end. The exit codes are
those of `run`, and besides: 2 where the server has no such tree, or refuses its inputs; 3 where a
goal of the run is not accounted for; 1 where the server is busy, is not in sight within 5 s, or
goes away (the next `serve` there cancels the goals that it left).
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "call",
        help="let a server of trees run a tree",
        description="Let a server of trees (`bt-actions serve`) run a tree, and show the run.",
        epilog=_EPILOG,
    )
    parser.add_argument("tree", metavar="TREE", help="name of the tree at the server")
    add_option(parser, "--set")
    parser.add_argument(
        "--server",
        metavar="NAME",
        type=action_name,
        default="run_tree",
        help="action of the server (default: run_tree)",
    )
    add_option(parser, "--namespace", help="namespace of the server")
    add_option(parser, "--timeout")
    add_option(parser, "--json")
    add_option(parser, "--quiet")
    add_options(parser, one_run=True)
    add_ros_args(parser, "; parameters (-p NAME:=VALUE) give inputs their values as for `run`")


def run(args: argparse.Namespace) -> int:
    """Let the server run the tree, and see the goal to its end."""
    if args.json:
        keep_results_apart()
    records = recorder(args)
    goal_name = f"bt-actions call {uuid.uuid4().hex[:12]}"
    name = f"bt_actions_{os.getpid()}_call"
    given = parameters(args.ros_args, name, args.namespace)
    inputs = nested(dict(given.values) if given else {}) | goal_fields(args.set, "--set")
    leaf = _leaf(args.tree, args.server, inputs, goal_name)

    from bt_actions.cli.driving.session import Session
    from bt_actions.cli.views.lines import QuietView
    from bt_actions.cli.views.served_run import CallJsonView, CallView, rejection
    from bt_actions.goals.policy import Outcome

    def judge(code: Exit) -> tuple[Exit, str]:
        rejected = code is Exit.FAILURE and leaf.outcome is Outcome.REJECTED
        return rejection(goal_name) if rejected else (code, "")

    with Session(leaf, namespace=args.namespace, name=name, recorder=records) as session:
        view: View = CallView(session.state, sys.stdout, feedback=True)
        if args.json:
            view = session.json_view(CallJsonView)
        elif args.quiet:
            view = QuietView(session.state, sys.stdout)
        code = session.run(view, timeout=args.timeout, judge=judge)
    ended = session.state.ended
    if ended is not None and ended.error and leaf.outcome is Outcome.REJECTED:
        note(f"bt-actions call: {ended.error}")
    return code


def _leaf(tree: str, server: str, inputs: dict[str, object], goal_name: str) -> RunTree:
    """Return the leaf, after all checks that need no server."""
    from bt_actions.behaviours.run_tree import RunTree, inputs_text

    try:
        inputs_text(inputs)
    except ValueError as error:
        raise BadInput(f"--set: {error}") from error
    leaf = RunTree(tree, tree, inputs, server=server, goal_name=goal_name)
    leaf.hides_goal = True  # its inputs are known to who gave them, and may be secrets there
    return leaf
