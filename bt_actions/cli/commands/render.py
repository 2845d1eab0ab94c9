"""`bt-actions render`: a tree as text on the terminal, or as a file in one of render's formats.

Never needs a ROS graph, and never imports rclpy.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.loading import load
from bt_actions.cli.arguments.options import add_option, number
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.results import keep_results_apart, results
from bt_actions.cli.streams.writing import write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions render trees/pick_and_place.yaml
  bt-actions render pick_and_place -o tree.svg
  bt-actions render pick_and_place -o tree.html    # to open in a browser
  bt-actions render large -o top.svg --depth 2     # the upper three levels of a large tree
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "render",
        help="draw a tree",
        description="Draw a tree: text to the terminal, or a file in the format of its suffix. "
        "Graphviz need not be installed. An .html file folds, shows each node's YAML, policies and "
        "types, and needs no network.",
        epilog=_EPILOG,
    )
    parser.add_argument("tree", metavar="TREE", help="path or name of a tree")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="file to write: .txt, .dot, .svg, .png or .html; without it, text to standard output",
    )
    parser.add_argument(
        "--direction",
        choices=("down", "right"),
        help="where a picture grows to (default: down, or right where the tree is wide)",
    )
    parser.add_argument(
        "--depth",
        metavar="LEVELS",
        type=number("number of levels: 0, 1, 2 ...", int, 0, 999_999),
        help="show so many levels below the root and say how many nodes are left out; "
        "an .html file has all and starts folded to it",
    )
    add_option(parser, "--set")
    add_option(parser, "--no-python")


def run(args: argparse.Namespace) -> int:
    """Draw the tree that `args` name."""
    keep_results_apart()
    from bt_actions import render
    from bt_actions.document.describing import nodes_of

    try:
        if args.output is not None:
            render.form_of(args.output)  # before the tree: the cheaper mistake first
        root = load(args.tree, args.set, python=args.python)
        if args.output is not None:
            from bt_actions.document.cards import cards_of

            cards = cards_of(root) if args.output.suffix.lower() == ".html" else ()
            render.write(
                nodes_of(root), args.output, direction=args.direction, depth=args.depth, cards=cards
            )
        else:
            encoding = results().encoding or "ascii"
            write(render.text(nodes_of(root), encoding=encoding, depth=args.depth))
    except render.RenderError as error:
        raise BadInput(str(error)) from error
    return Exit.SUCCESS
