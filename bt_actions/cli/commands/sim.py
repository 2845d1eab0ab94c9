"""`bt-actions sim`: simulated robots in a process of their own, until Ctrl-C.

The command prints one line `ready: ...` once the servers are up, and a line for each event of a
part. A standard output without a reader does not end it: it is a server.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from bt_actions.cli.arguments.options import add_option, count, seconds
from bt_actions.cli.arguments.ros_arguments import add_ros_args, no_parameters
from bt_actions.cli.driving.serving import say, serve
from bt_actions.cli.exits import BadInput, Exit

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.simulation import Simulation, WorldEvent

_EPILOG = """\
examples:
  bt-actions sim --speed 10
  bt-actions sim --namespace /r1 --namespace /r2
  bt-actions sim --robots 50 --speed 10
  bt-actions sim --fault move_robot:2:abort --fault gripper_control:5%:stall --seed 7
  bt-actions sim --journal goals.jsonl
in a launch file:
  Node(package="bt_actions", executable="bt-actions", namespace="r1", arguments=["sim"])

A part lies at 2 m (pick); the shelf is at 5 m, home at 0 m. Ctrl-C and SIGTERM end it: exit code 0.
The process uses ROS_DOMAIN_ID, as all ROS programs do.

faults are written SERVER:N|*|P%:FAULT[=VALUE]: which server (move_robot, /r1/move_robot, or * for
all), which of its goals (by number, all, or so many of a hundred), what it does wrong; times are
wall seconds, defaults stand in brackets:
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    from bt_actions.simulation.faults import table

    parser = subparsers.add_parser(
        "sim",
        help="serve simulated robots",
        description="Serve move_robot and gripper_control for simulated robots until Ctrl-C.",
        epilog=_EPILOG + table(),
    )
    which = parser.add_mutually_exclusive_group()
    add_option(
        which,
        "--namespace",
        action="append",
        default=[],
        help="move all names into this namespace; repeat it for several robots",
    )
    which.add_argument(
        "--robots", metavar="N", type=count("robots"), help="serve so many robots, in /r1, /r2, ..."
    )
    add_option(parser, "--speed", default=1.0, help="simulated seconds in one second (default 1)")
    parser.add_argument(
        "--step-period",
        metavar="S",
        type=seconds,
        default=0.1,
        help="simulated seconds between two steps (default 0.1)",
    )
    add_option(parser, "--fault", help="make a server misbehave; repeatable, see below")
    add_option(parser, "--seed")
    parser.add_argument(
        "--journal",
        metavar="FILE",
        help="append the events of every goal, one JSON object a line",
    )
    add_option(parser, "--executor")
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends it, or the executor dies."""
    no_parameters(args.ros_args, "sim", "simulation")
    return serve(
        "sim",
        lambda node: _simulation(node, args),
        announce=lambda simulation: _announce(simulation, args),
        conclude=_conclude,
        name="simulation",
        executor=args.executor,
    )


def _conclude(simulation: Simulation, code: Exit) -> Exit:
    if code is Exit.SUCCESS:
        say(simulation.describe())
    return code


def _simulation(node: Any, args: argparse.Namespace) -> Simulation:
    from bt_actions.simulation import FaultError, Simulation

    namespaces = args.namespace or [""]
    if args.robots is not None:
        namespaces = [f"/r{number}" for number in range(1, args.robots + 1)]
    try:
        return Simulation(
            node,
            namespaces=namespaces,
            speed=args.speed,
            step_period=args.step_period,
            faults=args.fault,
            seed=args.seed,
            journal=args.journal,
            in_process=False,
            on_event=_tell,
        )
    except FaultError as error:
        raise BadInput(f"--fault {error}") from error
    except OSError as error:
        raise BadInput(f"--journal {args.journal}: {error.strerror}") from error


def _announce(simulation: Simulation, args: argparse.Namespace) -> None:
    names = [server.name for server in simulation.servers]
    shown = ", ".join(names) if len(names) <= 4 else f"{names[0]} to {names[-1]}"
    count = "" if len(names) <= 4 else f", {len(names) // 2} robots"
    seed = f", seed {simulation.seed}" if args.fault else ""
    say(f"ready: {shown}{count}, speed {args.speed:g}{seed}")


def _tell(_namespace: str, event: WorldEvent) -> None:
    say(str(event))
