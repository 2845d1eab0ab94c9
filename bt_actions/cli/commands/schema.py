"""`bt-actions schema`: JSON Schema of the tree language, for editors."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.writing import write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions schema > tree.schema.json

With the YAML extension of VS Code (and every editor that has yaml-language-server), this line at
the top of a tree beside it gives completion and descriptions:
  # yaml-language-server: $schema=tree.schema.json
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    subparsers.add_parser(
        "schema",
        help="print the language's JSON Schema",
        description="Print the JSON Schema of the tree language, for completion in editors.",
        epilog=_EPILOG,
    )


def run(args: argparse.Namespace) -> int:
    """Print the schema."""
    from bt_actions.document.schema import json_schema

    del args
    write(json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n")
    return Exit.SUCCESS
