"""`bt-actions explain CODE`: a rule, with a wrong and a right example."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "explain",
        help="explain a rule of the checker",
        description="Explain the rules of `bt-actions check`; without a code, list them.",
        epilog="examples:\n  bt-actions explain\n  bt-actions explain BT203\n",
    )
    parser.add_argument("code", metavar="CODE", nargs="?", help="such as BT203")


def run(args: argparse.Namespace) -> int:
    """Print the page of a rule, or the list of rules."""
    from bt_actions.document.findings.rules import RULES

    if args.code is None:
        write("".join(f"{rule.code}  {rule.severity:7}  {rule.title}\n" for rule in RULES.values()))
        return Exit.SUCCESS
    code = args.code.upper()
    if code not in RULES:
        near = [rule for rule in RULES if code.startswith(rule) or rule.endswith(code)]
        more = f"did you mean {near[0]!r}?" if len(near) == 1 else "`bt-actions explain` lists them"
        raise BadInput(f"there is no rule {args.code!r}; {more}")
    write(RULES[code].page())
    return Exit.SUCCESS
