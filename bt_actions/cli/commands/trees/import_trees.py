"""`bt-actions import`: trees of BehaviorTree.CPP's XML, written in our language."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import note, write
from bt_actions.utilities.whole_file import replace_file

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.importing.convert import Imported

_EPILOG = """\
examples:
  bt-actions import navigate_to_pose.xml -o trees
  bt-actions import main.xml parts.xml -o trees --map robot.yaml --report

exit codes:
  0 no node was refused   1 some nodes were refused   2 a file cannot be read or written
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "import",
        help="write XML trees of BehaviorTree.CPP and Nav2 as YAML",
        description="Write the trees of BehaviorTree.CPP's XML (3 and 4) as YAML, one file a tree. "
        "A failure replaces each node that our language cannot express, and the report names it.",
        epilog=_EPILOG,
    )
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help="a file of XML")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, required=True, help="the folder of the YAML"
    )
    parser.add_argument(
        "--map",
        metavar="FILE",
        type=Path,
        help="a map: the YAML of each leaf of your own; the importer knows Nav2's",
    )
    parser.add_argument(
        "--report",
        action="store_true",
        help="report converted nodes and attributes, too, not only others",
    )


def run(args: argparse.Namespace) -> int:
    """Import the files that `args` name."""
    from bt_actions.importing.convert import convert
    from bt_actions.importing.mapping import MapError, read_map
    from bt_actions.importing.report import Verdict

    try:
        mapping = read_map(args.map) if args.map is not None else None
    except MapError as error:
        raise BadInput(str(error)) from None
    imported = convert(args.files, mapping)
    if imported.failed:
        raise BadInput("\n".join(map(str, imported.failed)), prefixed=False)
    _write(imported, args.output)
    least = Verdict.CONVERTED if args.report else Verdict.DIFFERS
    for entry in imported.report:
        if entry.verdict >= least:
            write(f"{entry}\n")
    note(f"{imported.report.summary()}; {len(imported.files)} files in {args.output}")
    refused = any(entry.verdict is Verdict.REFUSED for entry in imported.report)
    return Exit.FAILURE if refused else Exit.SUCCESS


def _write(imported: Imported, folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in imported.files.items():
            if name.endswith(".py") and (folder / name).exists():
                note(f"{folder / name} exists, and stays as it is: the file may have code of yours")
                continue
            replace_file(folder / name, text.encode())
    except OSError as error:
        raise BadInput(f"{folder}: cannot be written: {error.strerror or error}") from None
