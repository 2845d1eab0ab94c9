"""`bt-actions serve`: trees in folders as one action, for other nodes to run by name, until Ctrl-C.

Prints one line `ready: ...` when goals are accepted. What happens to goals goes to the log.
"""

from __future__ import annotations

import argparse
import threading
from typing import TYPE_CHECKING

from bt_actions.cli.common import BadInput, Exit, namespace, no_ros, note, starting_ros
from bt_actions.cli.ros_arguments import add_ros_args, parameters
from bt_actions.cli.sim import say
from bt_actions.plain_text import raised

if TYPE_CHECKING:
    from rclpy.node import Node

    from bt_actions.cli.parser import Subparsers
    from bt_actions.cli.signals import Signals
    from bt_actions.serving import TreeServer

_EPILOG = """\
examples:
  bt-actions serve --trees trees
  bt-actions serve --trees package://my_robot/trees --policy queue --max 5 --namespace /r1
  ros2 action send_goal /run_tree bt_actions_interfaces/action/RunTree "{tree: pick_and_place}"

The action is `run_tree`, of type bt_actions_interfaces/action/RunTree; a tree's name is its file's.
A goal with an unknown tree or wrong inputs is rejected, and `~/rejections` and the log say why.
Ctrl-C and SIGTERM end it: all goals are canceled and drained first. A second Ctrl-C leaves at once
and says which goals are not accounted for (exit code 3).
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "serve",
        help="run trees for other nodes",
        description="Serve the trees in some folders as the action run_tree, until Ctrl-C.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--trees",
        metavar="DIR",
        action="append",
        default=[],
        help="a folder of trees, or package://NAME/trees; repeatable; nothing outside is read; "
        "./trees where not given",
    )
    parser.add_argument(
        "--policy",
        choices=("reject", "queue", "replace", "parallel"),
        default="reject",
        help="what to do with a goal while another runs (default: reject)",
    )
    parser.add_argument(
        "--max",
        metavar="N",
        type=_count,
        default=10,
        help="how many goals may wait (queue), or run (parallel); 10 where not given",
    )
    parser.add_argument(
        "--python",
        metavar="PACKAGE",
        action="append",
        default=[],
        help="a package whose classes the trees' python: nodes may name; repeatable",
    )
    parser.add_argument(
        "--namespace",
        metavar="NS",
        type=namespace,
        default="",
        help="namespace of the node, and thereby of run_tree and every relative action name",
    )
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends it, or the executor dies."""
    parameters(args.ros_args, args.namespace)
    try:
        from bt_actions.cli.signals import Signals
        from bt_actions.ros.spinning import Spinner
    except ImportError as error:
        raise no_ros(error) from error

    with Signals() as signals:
        errors: list[BaseException] = []

        def died(error: BaseException) -> None:
            errors.append(error)
            signals.poke()

        with starting_ros():
            spinner = Spinner(None, None, name="bt_actions_serve", namespace=args.namespace,
                              died=died)  # fmt: skip
        server = None
        try:
            server = _server(spinner.node, args)
            spinner.start()
            trees = server.catalog.entries()
            say(f"ready: {spinner.node.get_namespace().rstrip('/')}/run_tree, {len(trees)} trees")
            while not errors and not signals.wait(None)[0]:
                pass
        finally:
            if server is not None:
                _close(server, signals)
            spinner.stop(lambda: None)
    for each in server.unaccounted:
        note(f"bt-actions serve: may still be running: {each}")
    if errors:
        note(f"bt-actions serve: the executor died: {raised(errors[0])}")
    return Exit.UNKNOWN if server.unaccounted else Exit.FAILURE if errors else Exit.SUCCESS


def _close(server: TreeServer, signals: Signals) -> None:
    """Drain all; one more signal ends the wait."""
    closed = threading.Event()

    def close() -> None:
        try:
            server.close()
        finally:
            closed.set()
            signals.poke()

    threading.Thread(target=close, name="bt_actions-close").start()
    while not closed.is_set():
        if signals.wait(None)[0]:
            server.abandon()


def _server(node: Node, args: argparse.Namespace) -> TreeServer:
    from bt_actions.document import TreeNotFoundError
    from bt_actions.serving import TreeServer

    try:
        return TreeServer(
            node,
            trees=args.trees or ["trees"],
            policy=args.policy,
            most=args.max,
            python=args.python,
        )
    except (NotADirectoryError, TreeNotFoundError) as error:
        raise BadInput(f"--trees: {error}") from error


def _count(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if not 1 <= number <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of goals, 1 to 1000")
    return number
