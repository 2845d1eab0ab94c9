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
A killed process (kill -9, out of memory) cannot cancel its goals, and the robot goes on. `cleanup`
finds these goals by their ids in the status of every action in sight, and cancels them. `cleanup`
never touches goals of other clients, of a living process, of another machine or of another
container. A restarted container counts as another one. To avoid that, give each container a name
that stays, in BT_ACTIONS_MACHINE.

A server does not show a goal before it has accepted the goal. Goals that a dead process had sent,
and that no server had answered, are on record; `cleanup` waits for them for 30 s or more
(--accept). `cleanup` asks the servers in sight. Name an ACTION to fail where its server is not in
sight.

examples:
  bt-actions cleanup
  bt-actions cleanup /r1/move_robot
  bt-actions cleanup --look 10 --accept 120
  bt-actions run pick_and_place --cleanup-first
in a launch file:
  Node(package="bt_actions", executable="bt-actions", arguments=["cleanup", "/r1/move_robot"])

exit codes:
  0 no server in sight has a goal that was left (if none needs more than --accept for a goal)
  3 the end of a goal is unknown, or no action server is in sight, or a server is silent; with an
  ACTION, only its server counts
  129, 130, 131, 143 stopped by SIGHUP, Ctrl-C, Ctrl-\\, SIGTERM; the known ends are printed
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "cleanup",
        help="cancel the goals of a killed bt_actions process",
        description="Cancel the goals that killed bt_actions processes left on this machine.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "actions",
        metavar="ACTION",
        type=action_name,
        nargs="*",
        help="wait for the server of this action for up to 30 s; without it, exit code 3",
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
