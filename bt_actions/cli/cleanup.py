"""`bt-actions cleanup`: cancel the goals that a killed orchestrator of this machine left."""

from __future__ import annotations

import argparse
import os
from collections.abc import Collection
from typing import TYPE_CHECKING

from bt_actions.cli.common import (
    NO_ROS,
    BadInput,
    Exit,
    OutputLost,
    discard_stdout,
    note,
    refuse_domain,
    seconds,
    write,
)
from bt_actions.suggest import listing

if TYPE_CHECKING:
    from bt_actions.cli.parser import Subparsers
    from bt_actions.ros.cleanup import LeftBehind

_EPILOG = """\
A process that is killed (kill -9, out of memory) cannot cancel its goals; the robot goes on. This
finds them by their ids in the status of every action in sight. Goals of other clients are never
touched, nor those of an orchestrator that is alive, on another machine or in another container. A
container that is started again counts as another one, unless BT_ACTIONS_MACHINE names it: a name of
its own for each container, the same each time.

examples:
  bt-actions cleanup
  bt-actions cleanup --look 10
  bt-actions run pick_and_place --cleanup-first

exit codes:
  0 nothing is left   3 the end of a goal is unknown, or no action server is in sight, or silent
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "cleanup",
        help="cancel what a killed orchestrator left",
        description="Cancel the goals that killed bt_actions processes of this machine left.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--look", metavar="S", type=seconds, default=5.0, help="look for servers so long [5 s]"
    )
    parser.add_argument(
        "--patience",
        metavar="S",
        type=seconds,
        default=5.0,
        help="wait so long for the goals to end [5 s]",
    )


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    return sweep(args.look, args.patience)


def sweep(
    look: float, patience: float, wanted: Collection[str] | None = None, namespace: str = ""
) -> Exit:
    """Clean up, saying what is found and how it ended.

    Where no server of one of the `wanted` actions answers, or none of any action is in sight, and
    nobody says which are wanted, nobody can say: UNKNOWN.
    """
    from bt_actions.policy import End

    try:
        from bt_actions.ros.cleanup import CannotStart, cleanup
    except ImportError as error:
        raise BadInput(NO_ROS.format(error)) from error

    refuse_domain()

    def found(left: LeftBehind) -> None:
        note(f"canceling a goal of dead process {left.pid} on {left.action}: {left.goal_id.hex()}")

    actions: list[str] = []
    foreign: list[str] = []
    unseen: list[str] = []

    def missing(names: list[str], in_vain: bool) -> None:
        if in_vain:
            unseen.extend(names)
        else:
            note(f"waiting for {listing(names)}, where something may have been left")

    try:
        goals = cleanup(
            look=look,
            patience=patience,
            found=found,
            sighted=actions.append,
            elsewhere=lambda action, goal_id: foreign.append(f"{goal_id.hex()} on {action}"),
            wanted=wanted,
            namespace=namespace,
            missing=missing,
        )
    except CannotStart as error:
        raise BadInput(f"ROS 2 cannot start: {error}") from error
    if foreign:
        note(
            f"not touched: {', '.join(foreign)}: of bt_actions on another machine, or in another "
            "container, where it cannot be seen whether it is alive (see BT_ACTIONS_MACHINE)"
        )
    unknown = any(goal.end is End.UNKNOWN for goal in goals)
    try:
        for goal in goals:
            crowd = f": {goal.servers} servers of this name, and each may run it"
            write(
                f"{goal.action}  {goal.goal_id.hex()}  {goal.end}"
                f"{crowd if goal.servers > 1 else ''}\n"
            )
    except (OutputLost, BrokenPipeError):
        if not unknown:
            raise
        discard_stdout()
    if unknown:
        note("not all of them have ended; they may still be running")
        return Exit.UNKNOWN
    if unseen:
        note(
            f"no server of {listing(unseen)} answers: nobody can see what was left there"
            f"{'; start it, or run without --cleanup-first' if wanted else ''}"
        )
        return Exit.UNKNOWN
    if not goals:
        domain = os.environ.get("ROS_DOMAIN_ID", "") or "0"
        if not actions and wanted is None:
            note(
                f"no action is in sight in ROS domain {domain}: nobody can see what was left; "
                "start its server, or --look longer"
            )
            return Exit.UNKNOWN
        count = "1 action" if len(actions) == 1 else f"{len(actions)} actions"
        nothing = "nothing of this machine" if foreign else "nothing"
        write(f"{nothing} was left behind on the {count} in sight in ROS domain {domain}\n")
    return Exit.SUCCESS
