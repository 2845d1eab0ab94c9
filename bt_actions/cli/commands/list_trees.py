"""`bt-actions list`: the trees that the servers of trees in sight offer, with their inputs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from bt_actions.cli.arguments.options import add_option
from bt_actions.cli.arguments.ros_arguments import add_ros_args, no_parameters
from bt_actions.cli.exits import Exit, importing_ros, starting_ros
from bt_actions.cli.streams.results import keep_results_apart, results
from bt_actions.cli.streams.writing import note
from bt_actions.utilities.plain_text import as_json, clean

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions list
  bt-actions list --namespace /r1
  bt-actions list --json

`bt-actions call TREE` has one run, and `bt-actions control` pauses, resumes or halts a run.
Exit codes: 0, or 1 where no server is in sight within 5 s, or one does not answer.
"""
_STATES = ("OK", "KEPT_LAST_GOOD", "INVALID")


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "list",
        help="show the trees that servers offer",
        description="Show the trees that servers of trees (`bt-actions serve`) offer.",
        epilog=_EPILOG,
    )
    add_option(parser, "--namespace", help="only servers in or below this namespace")
    add_option(parser, "--json", help="print one JSON object")
    add_ros_args(parser)


def run(args: argparse.Namespace) -> int:
    """Ask all servers in sight, and print their trees."""
    no_parameters(args.ros_args, "list", "bt_actions_asks")
    keep_results_apart()
    with importing_ros():
        from bt_actions.serving.client import trees_in_sight
    with starting_ros():
        found = trees_in_sight(args.namespace)
    trees = {
        clean(name): told and [tree_data(each) for each in told] for name, told in found.items()
    }
    if args.json:
        results().write(as_json(trees) + "\n")
    else:
        results().write("".join(f"{line}\n" for line in text_of(trees)))
    for name in [name for name, told in trees.items() if told is None]:
        note(f"bt-actions list: {name} does not answer")
    if not trees:
        note(
            "bt-actions list: no server of trees is in sight; is `bt-actions serve` running, in "
            "this ROS_DOMAIN_ID, and in this namespace?"
        )
    return Exit.FAILURE if not trees or None in trees.values() else Exit.SUCCESS


def tree_data(tree: Any) -> dict[str, Any]:
    """Return a TreeInfo as plain data, without characters that a terminal obeys."""
    from bt_actions.messages.conversion import to_plain

    state = _STATES[tree.state] if tree.state < len(_STATES) else str(tree.state)
    goals = {
        sort: [bytes(each.uuid).hex() for each in getattr(tree, sort)]
        for sort in ("running", "paused", "waiting")
    }
    data: dict[str, Any] = _cleaned(to_plain(tree))
    return data | {"state": state} | goals


def _cleaned(data: Any) -> Any:
    if isinstance(data, dict):
        return {name: _cleaned(each) for name, each in data.items()}
    if isinstance(data, list):
        return [_cleaned(each) for each in data]
    return clean(data) if isinstance(data, str) else data


def text_of(servers: dict[str, list[dict[str, Any]] | None]) -> list[str]:
    """Return the lines for people: a server, its trees, their inputs."""
    lines: list[str] = []
    for server, trees in servers.items():
        lines.append(server)
        for tree in trees or ():
            said = [tree["description"]] if tree["description"] else []
            lines.append("  ".join([f"  {tree['name']}", *said]))
            for each in tree["inputs"]:
                unit = f" [{each['unit']}]" if each["unit"] else ""
                default = "" if each["required"] else f" = {each['default_json']}"
                about = f"  {each['description']}" if each["description"] else ""
                lines.append(f"    {each['name']}: {each['type']}{unit}{default}{about}")
            for each in tree["running"]:
                states = [state for state in ("paused", "waiting") if each in tree[state]]
                lines.append(f"    {' and '.join(states) or 'running'}: {each}")
            lines += [_finding_text(tree["state"], each) for each in tree["findings"]]
    return lines


def _finding_text(state: str, finding: dict[str, str]) -> str:
    if finding["code"] == "SAME_NAME":  # nothing is wrong with the tree; the text has both files
        return f"    WARNING: {finding['message']}"
    return f"    {state}: {finding['message']}  {finding['place']}"
