"""`bt-actions cleanup`: cancel the goals that a killed orchestrator of this machine left."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import action_name, seconds
from bt_actions.cli.arguments.ros_arguments import add_ros_args, no_parameters
from bt_actions.cli.driving.sweep import sweep
from bt_actions.cli.exits import importing_ros, starting_ros

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
A process that is killed (kill -9, out of memory) cannot cancel its goals; the robot goes on. This
finds them by their ids in the status of every action in sight. Goals of other clients are never
touched, nor those of an orchestrator that is alive, on another machine or in another container. A
container that is started again counts as another one, unless BT_ACTIONS_MACHINE names it: a name of
its own for each container, the same each time.

No server shows a goal that it has not accepted yet. What a dead process had sent, and nobody had
answered, is on record, and is awaited for half a minute or more (--accept). Otherwise a server that
is not in sight is not asked: name its action, and that is no success.

examples:
  bt-actions cleanup
  bt-actions cleanup /r1/move_robot
  bt-actions cleanup --look 10 --accept 120
  bt-actions run pick_and_place --cleanup-first
in a launch file:
  Node(package="bt_actions", executable="bt-actions", arguments=["cleanup", "/r1/move_robot"])

exit codes:
  0 no server in sight has a goal that was left (should none take longer to accept one: --accept)
  3 the end of a goal is unknown, or no action server is in sight, or one is silent; with an ACTION,
  where its server is (others are not asked)
  129, 130, 131, 143 stopped by SIGHUP, Ctrl-C, Ctrl-\\, SIGTERM; the ends known by then are told
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "cleanup",
        help="cancel the goals of a killed orchestrator",
        description="Cancel the goals that killed bt_actions processes of this machine left.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "actions",
        metavar="ACTION",
        type=action_name,
        nargs="*",
        help="wait for its server for up to 30 s, and fail where that is not in sight",
    )
    parser.add_argument(
        "--look", metavar="S", type=seconds, default=5.0, help="time to look for servers [5 s]"
    )
    parser.add_argument(
        "--patience",
        metavar="S",
        type=seconds,
        default=5.0,
        help="time for the goals to end [5 s]",
    )
    parser.add_argument(
        "--accept",
        metavar="S",
        type=seconds,
        default=0.0,
        help="time for a server to accept a goal [30 s, or the timeout.accept of the goal]",
    )
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    with importing_ros():
        from bt_actions.ros.naming import server_names
        from bt_actions.ros.onlooker import NODE
    no_parameters(args.ros_args, "cleanup", NODE)
    with starting_ros():
        wanted = server_names(args.actions, NODE) if args.actions else None
    return sweep(args.look, args.patience, wanted, accept=args.accept)
