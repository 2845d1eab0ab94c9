"""`bt-actions run TREE`: run a tree to its end, and see every goal to its end.

The parts come from other rooms: document loads the tree, simulation has the servers, runner ticks,
views show, and drive turns the end into an exit code.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.loading import load
from bt_actions.cli.arguments.options import add_option, metres, node_name
from bt_actions.cli.arguments.ros_arguments import add_ros_args, parameters
from bt_actions.cli.driving.record import add_options, recorder
from bt_actions.cli.driving.sweep import sweep
from bt_actions.cli.driving.viewing import add_option as add_view
from bt_actions.cli.driving.viewing import show
from bt_actions.cli.exits import BadInput, Exit, importing_ros, starting_ros
from bt_actions.cli.streams.results import keep_results_apart

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.ros.arguments import Given
    from bt_actions.ros.naming import Outlook

_EPILOG = """\
examples:
  bt-actions run pick_and_place --sim --speed 10
  bt-actions run trees/pick_and_place.yaml --set pick_at=2.0 --set place_at=4.5
  bt-actions run pick_and_place --sim --fault move_robot:2:abort
  bt-actions run pick_and_place --sim-like pick_and_place    # as in its newest recorded run
  bt-actions run patrol --namespace /r1 --timeout 600 --json
  bt-actions run patrol --ros-args --params-file patrol.yaml -p use_sim_time:=true

Ctrl-C, Ctrl-\\, SIGTERM, SIGHUP, --timeout and a closed standard output all end a run in the same
way: the run cancels every goal and waits for its end. A second Ctrl-C ends the wait, and the run
names the goals that may still run. Two signals within a quarter of a second count as one, as shells
and wrappers pass signals on. Exit codes: see `bt-actions --help`.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "run",
        help="run a tree",
        description="Run a tree. In a terminal the command draws the tree live; elsewhere the "
        "command prints a line for each change.",
        epilog=_EPILOG,
    )
    parser.add_argument("tree", metavar="TREE", help="path of a tree, or name of an installed one")
    add_option(parser, "--set")
    add_option(parser, "--executor")
    add_option(
        parser,
        "--namespace",
        help="namespace of the node, and thereby of every relative action name",
    )
    parser.add_argument(
        "--name",
        metavar="NAME",
        type=node_name,
        help="name of the node (default: bt_actions_TREE)",
    )
    add_option(parser, "--timeout", help="end the run after so many seconds, with exit code 124")
    parser.add_argument(
        "--cleanup-first",
        action="store_true",
        help="first cancel the goals that a killed bt_actions process of this machine left; wait "
        "30 s for the servers of the tree, and do not run the tree without them",
    )
    add_option(parser, "--no-python")
    add_option(parser, "--json")
    parser.add_argument(
        "--plain",
        action="store_true",
        help="print lines in a terminal, too, as in a pipe; TERM=dumb does the same",
    )
    parser.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="print a line for every state of every goal, too",
    )
    add_ros_args(
        parser,
        "; parameters (-p NAME:=VALUE, --params-file FILE) give inputs of the tree their values, "
        "unless --set does",
    )
    add_options(parser, one_run=True)
    add_view(parser)
    add_option(parser, "--publish-values")
    simulated = parser.add_argument_group("simulation")
    servers = simulated.add_mutually_exclusive_group()
    servers.add_argument(
        "--sim", action="store_true", help="run simulated action servers in this process"
    )
    servers.add_argument(
        "--sim-like",
        metavar="RUN",
        help="run action servers that answer as the servers of a recorded run did; RUN is a file, "
        "the first letters of an id, or a tree for its newest run",
    )
    add_option(
        simulated,
        "--fault",
        help="make a simulated server misbehave: SERVER:N|*|P%%:FAULT[=VALUE]; repeatable",
    )
    add_option(
        simulated,
        "--speed",
        help="speed of the simulated robot, not of the tree's deadlines (default: 1)",
    )
    add_option(simulated, "--seed")
    simulated.add_argument(
        "--check-part",
        metavar="METRES",
        type=metres,
        help="fail unless the simulated part lies at this place at the end",
    )


def run(args: argparse.Namespace) -> int:
    """Run the tree that `args` name."""
    if args.json:
        keep_results_apart()
    _refuse_without_sim(args)
    like = None if args.sim_like is None else _recorded(args.sim_like)
    is_simulated = args.sim or like is not None
    records = recorder(args)
    root = load(
        args.tree,
        args.set,
        python=args.python,
        parameters=(lambda tree: _given(args, tree)) if args.ros_args else None,
    )

    show(args)
    cleans_up = args.cleanup_first and not is_simulated  # a simulation is private
    servers = _servers(args, root) if cleans_up else []
    outlook = _outlook()  # early: it is to have seen other nodes when ours gets its name
    try:
        from bt_actions.cli.driving.session import Session, SimulationWish
        from bt_actions.document import tree_name

        if cleans_up:
            # Told on standard error: standard output is the run's.
            code = sweep(5.0, 5.0, servers, first="run without --cleanup-first")
            if code is not Exit.SUCCESS:
                outlook.close()
                return code
    except BaseException:
        outlook.close()
        raise
    wish = SimulationWish(args.speed or 1.0, args.fault, args.seed, like) if is_simulated else None
    with Session(
        root,
        executor=args.executor,
        namespace=args.namespace,
        simulation=wish,
        name=_node_name(args, tree_name(root)),
        outlook=outlook,
        recorder=records,
        publish_values=args.publish_values,
    ) as session:
        view = session.view(as_json=args.json, plain=args.plain, verbose=args.verbose)
        return session.run(view, timeout=args.timeout, part_at=args.check_part)


def _node_name(args: argparse.Namespace, tree: str) -> str:
    """Return the name of the run's node, before remapping."""
    from bt_actions.ros.naming import node_name as name_for

    name: str = args.name or name_for(tree)
    return name


def _given(args: argparse.Namespace, tree: str) -> Given | None:
    with importing_ros():
        return parameters(args.ros_args, _node_name(args, tree), args.namespace)


def _outlook() -> Outlook:
    with importing_ros():
        from bt_actions.ros.naming import Outlook
    with starting_ros():
        return Outlook()


def _servers(args: argparse.Namespace, root: Behaviour) -> list[str]:
    """Return the full names of the servers that the run will send goals to."""
    from bt_actions.behaviours.action import ActionBehaviour
    from bt_actions.document import tree_name

    actions = {each.action_name for each in root.iterate() if isinstance(each, ActionBehaviour)}
    name = _node_name(args, tree_name(root))
    with importing_ros():
        from bt_actions.ros.naming import server_names
    with starting_ros():
        return server_names(actions, name, args.namespace)


def _refuse_without_sim(args: argparse.Namespace) -> None:
    if args.sim:
        return
    without = ("--check-part", *(() if args.sim_like else ("--fault", "--speed", "--seed")))
    for option in without:
        if getattr(args, option[2:].replace("-", "_")) not in (None, []):
            raise BadInput(f"{option} is about the simulation; it needs --sim")


def _recorded(run: str) -> Path:
    from bt_actions.recording.folders import NoRun, find

    try:
        return find(run)
    except NoRun as error:
        raise BadInput(f"--sim-like: {error}") from error
