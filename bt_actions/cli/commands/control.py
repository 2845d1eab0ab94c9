"""`bt-actions control SERVER pause|resume|halt [ID]`: steer a run of a server of trees."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import action_name, add_option
from bt_actions.cli.arguments.ros_arguments import add_ros_args, no_parameters
from bt_actions.cli.exits import BadInput, Exit, importing_ros, starting_ros
from bt_actions.cli.streams.writing import note, write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions control /run_tree pause
  bt-actions control /r1/run_tree resume 9b0f41c2
  bt-actions control run_tree halt --namespace /r1

ID is the goal's id as `ros2 action send_goal` and `bt-actions list` print it, or its beginning; it
may be left out where one tree runs. A paused run begins no new goal, and those that run finish.
`halt` cancels its goals and ends it as aborted; Ctrl-C of its client cancels it.
Exit codes: 0; 1 where the server is not in sight within 5 s, does not answer, or runs nothing; 2
where it is not clear which run is meant.
"""
_DONE = {"pause": "paused", "resume": "resumed", "halt": "being halted"}


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "control",
        help="pause, resume or halt a run of a server",
        description="Pause, resume or halt a run of a server of trees (`bt-actions serve`).",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "server",
        metavar="SERVER",
        type=action_name,
        help="action of the server, such as /r1/run_tree",
    )
    parser.add_argument(
        "wish", metavar="pause|resume|halt", choices=tuple(_DONE), help="the change of the run"
    )
    parser.add_argument("goal", metavar="ID", nargs="?", default="", help="which run")
    add_option(parser, "--namespace", help="namespace of the server, where SERVER has no slash")
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Ask the server, and tell its answer."""
    beginning = args.goal.lower().replace("-", "")
    if not re.fullmatch("[0-9a-f]{0,32}", beginning):
        raise BadInput(
            f"{args.goal!r} is no goal's id: 32 hexadecimal digits, or the first of them"
        )
    no_parameters(args.ros_args, "control", "bt_actions_asks")
    server = args.server if args.server.startswith("/") else f"{args.namespace}/{args.server}"
    with importing_ros():
        from bt_actions.serving.client import NotControlled, control
    try:
        with starting_ros():
            which = control(server, args.wish, beginning)
    except NotControlled as error:
        note(f"bt-actions control: {error}")
        return Exit.BAD_INPUT if error.unclear else Exit.FAILURE
    write(f"{_DONE[args.wish]}: {which}\n")
    return Exit.SUCCESS
