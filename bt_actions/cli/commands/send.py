"""`bt-actions send SERVER TYPE [FIELD=VALUE]...`: one goal from the command line.

The command runs a tree of one leaf: the goal has the same life, deadlines and end as in any tree.
"""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import action_name, add_option
from bt_actions.cli.arguments.ros_arguments import add_ros_args, no_parameters
from bt_actions.cli.arguments.values import goal_fields
from bt_actions.cli.exits import BadInput

if TYPE_CHECKING:
    from bt_actions.behaviours.action import ActionBehaviour
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions send move_robot MoveRobot distance=2.0
  bt-actions send /r1/gripper_control Gripper position=0 max_effort=5
  bt-actions send navigate_to_pose nav2_msgs/NavigateToPose pose.header.frame_id=map \\
      pose.pose.position.x=1.0 --timeout 60
in a launch file:
  Node(package="bt_actions", executable="bt-actions",
       arguments=["send", "move_robot", "MoveRobot", "distance=2.0"])

Values are YAML: numbers, texts, true and false, [1, 2], {x: 1.0}. Ctrl-C cancels the goal and waits
for its end. Exit codes: see `bt-actions --help`.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "send",
        help="send one goal to an action server",
        description="Send one goal to an action server; show its feedback, outcome and result.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "server", metavar="SERVER", type=action_name, help="name of the action server"
    )
    parser.add_argument(
        "type", metavar="TYPE", help="its action type: MoveRobot, pkg/MoveRobot or the full name"
    )
    parser.add_argument(
        "fields",
        metavar="FIELD=VALUE",
        nargs="*",
        default=[],
        help="fields of the goal; others keep defaults",
    )
    add_option(parser, "--timeout")
    add_option(parser, "--namespace", help="namespace of the server")
    parser.add_argument(
        "--feedback",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="show feedback (default), or not",
    )
    add_option(parser, "--quiet")
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Send the goal that `args` describe, and see it to its end."""
    leaf = _leaf(args.server, args.type, goal_fields(args.fields))
    name = f"bt_actions_{os.getpid()}_send"
    no_parameters(args.ros_args, "send", name, args.namespace)

    from bt_actions.cli.driving.session import Session
    from bt_actions.cli.views.lines import QuietView
    from bt_actions.cli.views.one_goal import GoalView
    from bt_actions.cli.views.view import View

    with Session(leaf, namespace=args.namespace, name=name) as session:
        view: View = GoalView(session.state, sys.stdout, feedback=args.feedback)
        if args.quiet:
            view = QuietView(session.state, sys.stdout)
        return session.run(view, timeout=args.timeout)


def _leaf(server: str, type_name: str, data: dict[str, object]) -> ActionBehaviour:
    """Return the leaf, after all checks that need no server."""
    from bt_actions.messages.conversion import MessageError, fill
    from bt_actions.messages.interfaces import UnknownInterface, called

    try:
        action_type = called(type_name, "action")
        goal = fill(action_type.Goal, data)  # type: ignore[attr-defined]  # made by rosidl
    except (UnknownInterface, MessageError) as error:
        raise BadInput(str(error)) from error

    from bt_actions.behaviours.action import ActionBehaviour

    return ActionBehaviour(server, action_type, server, goal)
