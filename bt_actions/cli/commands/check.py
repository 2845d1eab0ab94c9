"""`bt-actions check`: everything that a tree's text tells, at once, before a robot moves."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import add_option
from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.results import keep_results_apart, results
from bt_actions.cli.streams.writing import columns, write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.document import Finding

_EPILOG = """\
examples:
  bt-actions check trees/*.yaml
  bt-actions check --no-types --format json trees/pick_and_place.yaml
  bt-actions check - < tree.yaml

exit codes:
  0 nothing found   1 something found   2 a file cannot be read
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "check",
        help="find mistakes in trees",
        description="Check trees, with all that they include, against the language and the ROS "
        "types that are installed.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "trees", metavar="TREE", nargs="+", help="path or name of a tree; - is standard input"
    )
    parser.add_argument(
        "--no-types",
        action="store_true",
        help="look up no ROS interface, and no class of a python: node",
    )
    add_option(parser, "--no-python")
    parser.add_argument(
        "--format",
        choices=("text", "json"),
        default="text",
        help="format of the findings (default: text)",
    )


def run(args: argparse.Namespace) -> int:
    """Check the trees that `args` name."""
    keep_results_apart()
    from bt_actions.document.findings.reports import as_json, as_text

    findings: list[Finding] = []
    seen = set()
    unreadable = False
    for tree in args.trees:
        for finding in _check(tree, types=not args.no_types, python=args.python):
            if finding not in seen:  # trees share what they include
                seen.add(finding)
                findings.append(finding)
                unreadable |= finding.code in ("BT100", "BT101")
    is_text = args.format == "text"
    write(as_text(findings, columns(results())) if is_text else as_json(findings))
    if unreadable:
        return Exit.BAD_INPUT
    return Exit.FAILURE if findings else Exit.SUCCESS


def _check(tree: str, *, types: bool, python: bool) -> list[Finding]:
    from bt_actions.document import DocumentError, check_file, check_source
    from bt_actions.document.yaml.source import read_stream

    if tree != "-":
        return check_file(tree, types=types, python=python)
    try:
        source = read_stream(getattr(sys.stdin, "buffer", None), "<stdin>")
    except DocumentError as error:
        return list(error.findings)
    return check_source(source, types=types, python=python)
