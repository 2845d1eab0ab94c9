"""`bt-actions send SERVER TYPE [FIELD=VALUE]...`: one goal from the command line.

It is a tree of one leaf, so that the goal has the same life, deadlines and end as in any tree.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, TextIO

from bt_actions.cli.common import BadInput, namespace, seconds
from bt_actions.cli.ros_arguments import add_ros_args, parameters
from bt_actions.cli.values import goal_fields

if TYPE_CHECKING:
    from bt_actions.behaviours.action import ActionBehaviour
    from bt_actions.cli.parser import Subparsers
    from bt_actions.cli.words import Closing
    from bt_actions.events import Event
    from bt_actions.running.report import Report, Row

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
    parser.add_argument("server", metavar="SERVER", help="name of the action server")
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
    parser.add_argument(
        "--timeout", metavar="S", type=seconds, help="cancel after so many seconds, exit code 124"
    )
    parser.add_argument(
        "--namespace", metavar="NS", type=namespace, default="", help="namespace of the server"
    )
    parser.add_argument(
        "--feedback",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="show feedback (default), or not",
    )
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="show only what went wrong; the exit code tells"
    )
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Send the goal that `args` describe, and see it to its end."""
    leaf = _leaf(args.server, args.type, goal_fields(args.fields))
    parameters(args.ros_args, args.namespace)

    from bt_actions.cli.session import Session
    from bt_actions.cli.views import QuietView, View

    with Session(leaf, namespace=args.namespace) as session:
        view: View = GoalView(session.report, leaf, sys.stdout, feedback=args.feedback)
        if args.quiet:
            view = QuietView(session.report, sys.stdout)
        return session.run(view, timeout=args.timeout)


def _leaf(server: str, type_name: str, data: dict[str, object]) -> ActionBehaviour:
    """Check everything that can be checked without a server."""
    from bt_actions.document.ros_names import why_not
    from bt_actions.messages.conversion import MessageError, UnknownInterface, fill, find_action

    why = why_not(server)
    if why:
        raise BadInput(f"{server!r} cannot be the name of an action server: {why}")
    try:
        action_type = find_action(type_name)
        goal = fill(action_type.Goal, data)  # type: ignore[attr-defined]  # made by rosidl
    except UnknownInterface as error:
        raise BadInput(str(error)) from error
    except MessageError as error:
        raise BadInput(str(error)) from error

    from bt_actions.behaviours.action import ActionBehaviour

    return ActionBehaviour(server, action_type, server, goal)


class GoalView:
    """One line a change of the goal; on a terminal, feedback is rewritten in place."""

    fileno = -1

    def __init__(
        self, report: Report, leaf: ActionBehaviour, out: TextIO, *, feedback: bool
    ) -> None:
        self._report = report
        self._leaf = leaf
        self._out = out
        self._feedback = feedback
        self._last = ""
        self._last_feedback = ""
        self._in_place = out.isatty() and feedback
        self._drawn = False

    def event(self, event: Event) -> None:
        """Write where the goal stands, when that has changed."""
        from bt_actions.cli.words import goal_text
        from bt_actions.events import GoalChanged

        if not isinstance(event, GoalChanged):
            return
        text = goal_text(self._report.row(event.behaviour))
        if event.outcome is None and text != self._last:
            self._last = text
            self._line(text)

    def frame(self) -> None:
        """Show the latest feedback."""
        for row in self._report.live if self._feedback else ():
            text = self.feedback_text(row)
            if text and text != self._last_feedback:
                self._last_feedback = text
                self._show_feedback(text)

    def say(self, text: str) -> None:
        """Write `text` on a line of its own."""
        self._line(text)

    def finish(self, closing: Closing) -> None:
        """Write the result and the outcome."""
        from bt_actions.cli.words import CLEAN_UP, goal_text, stood_still
        from bt_actions.goals.policy import Outcome

        for line in self.result_lines():
            self._line(line)
        for row in self._report.rows:
            if closing.cause and row.outcome is Outcome.CANCELED:
                row.reason = closing.cause  # here is no tree that could have interrupted it
            self._line(f"{goal_text(row)}, after {self._report.seconds(row):.2f} s")
        if closing.error:
            self._line(closing.error)
        if self._report.servers_gone:
            self._line(stood_still(self._report))
        if self._report.unaccounted:
            self._line(CLEAN_UP)
        for line in self._report.unaccounted:
            self._line(f"not accounted for: {line}")

    def feedback_text(self, row: Row) -> str:
        """Return the latest feedback on one line."""
        from bt_actions.cli.words import feedback_text

        return feedback_text(row)

    def result_lines(self) -> list[str]:
        """Return what the goal's result says."""
        from bt_actions.cli.words import result_lines
        from bt_actions.goals.policy import End

        if self._leaf.end not in (End.SUCCEEDED, End.ABORTED):
            return []  # only these have a result of their own
        return result_lines(self._leaf.result)

    def close(self) -> None:
        """Leave the line that feedback was drawn on."""
        if self._drawn:
            self._line("")

    def _show_feedback(self, text: str) -> None:
        if not self._in_place:
            self._line(f"  {text}")
            return
        self._out.write(f"\r\x1b[K  {text}")
        self._out.flush()
        self._drawn = True

    def _line(self, text: str) -> None:
        start = "\r\x1b[K" if self._drawn else ""
        self._drawn = False
        self._out.write(f"{start}{text}\n" if text else start)
        self._out.flush()
