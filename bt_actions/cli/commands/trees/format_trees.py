"""`bt-actions format`: trees in canonical form, comments kept."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.loading import findings_text
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import note, write
from bt_actions.utilities.whole_file import replace_file

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions format trees/*.yaml
  bt-actions format --check trees/*.yaml
  bt-actions format - < tree.yaml

exit codes:
  0 done, or nothing to do   1 with --check: a file would change   2 a file cannot be formatted
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "format",
        help="rewrite trees in canonical form",
        description="Rewrite trees in canonical form: two spaces, the kind of a node first, keys "
        "in the order of the reference. Comments are kept.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "files", metavar="FILE", nargs="+", help="a tree; - reads and writes the standard streams"
    )
    parser.add_argument(
        "--check", action="store_true", help="change nothing; say what would change"
    )


def run(args: argparse.Namespace) -> int:
    """Format the files that `args` name."""
    changed = failed = False
    for name in args.files:
        try:
            changed |= _format(name, check=args.check)
        except BadInput as error:  # the other files are no worse for it
            note(f"bt-actions: {error}" if error.prefixed else str(error))
            failed = True
    if failed:
        return Exit.BAD_INPUT
    return Exit.FAILURE if args.check and changed else Exit.SUCCESS


def _format(name: str, *, check: bool) -> bool:
    """Format one file, or only look with `check`; return whether it changes."""
    before, after = _formatted(name)
    if name == "-" and not check:
        write(after)
    elif before != after:
        if not check:
            _replace(Path(name), after)
        note(f"{name}: {'would change' if check else 'formatted'}")
        return True
    return False


def _formatted(name: str) -> tuple[str, str]:
    from bt_actions.document import DocumentError
    from bt_actions.document.formatting.format import FormatError, format_source
    from bt_actions.document.yaml.source import read_source, read_stream

    try:
        if name == "-":
            source = read_stream(getattr(sys.stdin, "buffer", None), "<stdin>")
        else:
            source = read_source(Path(name), name)
        return source.text, format_source(source)
    except DocumentError as error:
        raise BadInput(findings_text(error), prefixed=False) from None
    except FormatError as error:
        raise BadInput(f"{name}: {error}; the file is unchanged") from None


def _replace(path: Path, text: str) -> None:
    try:
        replace_file(path, text.encode())
    except OSError as error:
        raise BadInput(f"{path}: cannot be written: {error.strerror or error}") from None
