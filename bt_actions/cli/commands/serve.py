"""`bt-actions serve`: trees in folders as one action, for other nodes to run by name, until Ctrl-C.

The command prints one line: `ready: ...` once goals are accepted, `unconfigured: ...` with
--managed. Behind another server of the action, it prints `waiting: ...` before. The log tells of
goals.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from bt_actions.cli.arguments.options import MOST, add_option, count
from bt_actions.cli.arguments.ros_arguments import add_ros_args, parameters, taken
from bt_actions.cli.driving.record import add_options, recorder
from bt_actions.cli.driving.serving import say, serve
from bt_actions.cli.driving.sweep import sweep
from bt_actions.cli.driving.viewing import add_option as add_view
from bt_actions.cli.driving.viewing import show
from bt_actions.cli.exits import BadInput, Exit, importing_ros, leave, refuse_domain
from bt_actions.cli.streams.writing import note
from bt_actions.utilities.suggest import listing

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.cli.driving.signals import Signals
    from bt_actions.serving import TreeServer

NAME = "bt_actions_serve"
_EPILOG = """\
examples:
  bt-actions serve --trees trees
  bt-actions serve --trees package://my_robot/trees --policy queue --max 5 --namespace /r1
  bt-actions serve --ros-args --params-file serve.yaml
  ros2 action send_goal /run_tree bt_actions_interfaces/action/RunTree "{tree: pick_and_place}"

The action is `run_tree`, of type bt_actions_interfaces/action/RunTree. The name of a tree is that
of its file. `serve` rejects a goal with an unknown tree or wrong inputs; `~/rejections` and the log
have the reason.
Where another server of the action is in sight, this one waits until the other is gone.
After a crash, `serve` first cancels the goals that the killed server left; where an action server
of these goals is not in sight, the exit code is 3.
At Ctrl-C and SIGTERM `serve` cancels all goals, and waits for their ends. A second Ctrl-C ends the
wait, and `serve` names the goals that may still run (exit code 3).
"""

_POLICIES = ("reject", "queue", "replace", "parallel")
_ONE_AT_A_TIME = ("reject", "replace")
_LISTS = {"trees": "DIR", "python": "PACKAGE"}
_HELP = {
    "trees": "a folder of trees, or package://NAME/trees; repeatable; serve reads no file outside "
    "(default: ./trees)",
    "policy": "the reaction to a goal while another one runs (default: reject)",
    "max": "how many goals may wait (queue), or run (parallel) (default: 10)",
    "python": "a package whose classes the trees' python: nodes may name; repeatable",
    "managed": "stay unconfigured until a lifecycle manager configures and activates the node",
}
"""Help for the options that are parameters of the node, too."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "serve",
        help="run trees for other nodes",
        description="Serve the trees in some folders as the action run_tree, until Ctrl-C.",
        epilog=_EPILOG,
    )
    for name, help_text in _HELP.items():
        kind: dict[str, Any] = {"metavar": "N", "type": count("goals")}
        if name in _LISTS:
            kind = {"metavar": _LISTS[name], "action": "append"}
        elif name == "policy":
            kind = {"choices": _POLICIES}
        elif name == "managed":
            kind = {"action": "store_true", "default": None}
        parser.add_argument(f"--{name}", help=help_text, **kind)
    add_option(
        parser,
        "--namespace",
        help="namespace of the node, and thereby of run_tree and every relative action name",
    )
    add_options(parser, one_run=False)
    add_view(parser)
    add_option(parser, "--publish-values")
    more = f"; the parameters {listing(_HELP)} apply where the options are not given"
    add_ros_args(parser, more)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends it, or the executor dies."""
    given = parameters(args.ros_args, NAME, args.namespace)
    what = "parameter of bt-actions serve"
    options = _options(args, taken(given, _HELP, what, other_users=True))
    records = recorder(args)
    show(args, "runs")
    code = _clean_up()
    if code is not Exit.SUCCESS:
        return code
    return serve(
        "serve",
        lambda node: _server(node, options, recorder=records, publish_values=args.publish_values),
        announce=lambda server: _announce(server, managed=options["managed"]),
        close=_close,
        conclude=_conclude,
        name=NAME,
        namespace=args.namespace,
    )


def _close(server: TreeServer, signals: Signals) -> None:
    """Close the server; one more signal ends the wait, and leaves a run that does not end then."""
    signals.during(server.close, lambda _: server.abandon())
    for each in server.stuck:
        note(f"bt-actions serve: may still be running: {each}")
    if server.stuck:
        leave(_conclude(server, Exit.UNKNOWN))


def _conclude(server: TreeServer, code: Exit) -> Exit:
    if left := len(server.unaccounted):
        goals = "1 goal is" if left == 1 else f"{left} goals are"
        note(f"bt-actions serve: {goals} not accounted for; the log names each")
    return Exit.UNKNOWN if left else code


def _clean_up() -> Exit:
    """Cancel the goals of a killed server, where one is on record; other starts lose no time."""
    with importing_ros():
        from bt_actions.serving.underway import left_underway

    refuse_domain()
    try:
        left = dict(left_underway(int(os.environ.get("ROS_DOMAIN_ID") or "0", 0)))
    except ValueError:  # rcl says why
        return Exit.SUCCESS
    except OSError as error:
        note(f"bt-actions serve: nothing can be put on record there, nor was: {error}")
        return Exit.SUCCESS
    if not left:
        return Exit.SUCCESS
    actions = sorted(set().union(*left.values()))
    before = "an earlier one ended before it knew how its goals had ended"
    note(f"bt-actions serve: {before}; cleaning up: {listing(actions)}")
    files = listing(map(str, left))
    instead = f"remove {files} if it will not come back, and nothing moves"
    code = sweep(look=1.0, patience=5.0, wanted=actions, first=instead)
    if code is Exit.SUCCESS:
        for path in left:
            path.unlink(missing_ok=True)
    else:
        note("bt-actions serve: accepts no goals before that is settled")
    return code


def _options(args: argparse.Namespace, given: Mapping[str, object]) -> dict[str, Any]:
    """Return the server's settings, of the command line or of parameters. Raises BadInput."""
    options = {name: getattr(args, name) for name in _HELP}
    for name, option in options.items():
        if option is None and name in given:
            options[name] = _checked(name, given[name])
    policy = options["policy"] = options["policy"] or "reject"
    if options["max"] is not None and policy in _ONE_AT_A_TIME:
        raise BadInput(f"--max is for the policies queue and parallel, and this is {policy}")
    defaults = {"trees": ["trees"], "max": 10, "python": [], "managed": False}
    return {name: options[name] or defaults.get(name) for name in _HELP} | {"policy": policy}


def _checked(name: str, value: object) -> object:
    if name in _LISTS:
        wanted = "a list of texts"
        fits = isinstance(value, list | tuple) and all(isinstance(each, str) for each in value)
        value = list(value) if isinstance(value, list | tuple) else value
    elif name == "policy":
        wanted, fits = listing(_POLICIES), value in _POLICIES
    elif name == "max":
        wanted = f"a whole number, 1 to {MOST}"
        fits = type(value) is int and 1 <= value <= MOST
    else:
        wanted, fits = "true or false", isinstance(value, bool)
    if not fits:
        raise BadInput(f"--ros-args: the parameter {name!r} is {value!r}, and not {wanted}")
    return value


def _server(node: Any, options: Mapping[str, Any], **more: Any) -> TreeServer:
    from rcl_interfaces.msg import IntegerRange, ParameterDescriptor

    from bt_actions.document import TreeNotFoundError
    from bt_actions.ros.parameters import declare, typed
    from bt_actions.serving import TreeServer

    for name, value in options.items():
        if name == "max" and options["policy"] in _ONE_AT_A_TIME:
            continue  # or else what is shown could not be given
        descriptor = ParameterDescriptor(description=_HELP[name])
        if name == "policy":
            descriptor.additional_constraints = listing(_POLICIES)
        elif name == "max":
            descriptor.integer_range = [IntegerRange(from_value=1, to_value=MOST, step=1)]
        try:
            declare(node, typed(name, value), descriptor)
        except UnicodeEncodeError as error:
            words = listing([value] if isinstance(value, str) else value)
            raise BadInput(f"--{name}: {words} is no UTF-8, as ROS wants it") from error
    try:
        return TreeServer(
            node,
            trees=options["trees"],
            policy=options["policy"],
            most=options["max"],
            python=options["python"],
            managed=True,
            **more,
        )
    except (OSError, TreeNotFoundError) as error:
        raise BadInput(f"--trees: {error}") from error


def _announce(server: TreeServer, *, managed: bool) -> None:
    if managed:
        say(f"unconfigured: {server.node.get_fully_qualified_name()}")
        return
    assert server.lifecycle is not None
    server.lifecycle.change("configure")
    server.lifecycle.change("activate")
    entries = server.catalog.entries()
    broken = [each.name for each in entries if each.tree is None]
    more = f", {len(broken)} broken: {listing(broken)}" if broken else ""
    if hidden := [str(file) for each in entries for file in each.hides]:
        more += f"; {len(hidden)} not served, as another has the name: {listing(hidden, 1)}"
    name = f"{server.node.get_namespace().rstrip('/')}/run_tree"
    ready = f"ready: {name}, {len(entries) - len(broken)} trees{more}"
    server.precedence.regained = lambda: say(ready)
    say(f"waiting: {server.precedence.why}" if server.precedence.yields() else ready)
