"""The choice to record a command's runs, by its options and the environment."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.exits import BadInput
from bt_actions.cli.streams.writing import note

if TYPE_CHECKING:
    from bt_actions.recording.recorder import Recorder

VARIABLE = "BT_ACTIONS_RECORD"
_WORDS = ("off", "events", "all")


def add_options(parser: argparse.ArgumentParser, *, one_run: bool) -> None:
    """Add `--no-record` and `--record`: a file for one run, or a folder for several."""
    group = parser.add_argument_group("recording").add_mutually_exclusive_group()
    group.add_argument(
        "--no-record",
        action="store_true",
        help=f"keep no recording; {VARIABLE}=off|events|all says so for all (events: no values)",
    )
    group.add_argument(
        "--record",
        metavar="FILE" if one_run else "DIR",
        type=Path,
        help="record to this .mcap file, which is never removed by itself"
        if one_run
        else "record each run below this folder",
    )


def recorder(args: argparse.Namespace) -> Recorder:
    """Return the recorder of the command's runs, or one that says that none is kept.

    Raises BadInput.
    """
    how = os.environ.get(VARIABLE) or "all"
    if how not in _WORDS:
        raise BadInput(f"{VARIABLE} is {how!r}; it is one of {', '.join(_WORDS)}")
    path: Path | None = args.record
    from bt_actions.recording.recorder import Recorder, Wish

    if args.no_record or (how == "off" and path is None):
        wish = Wish(why_not="--no-record" if args.no_record else f"{VARIABLE}=off")
    elif args.command == "serve":
        wish = Wish(where=path, values=how != "events")
    else:
        if path is not None:
            _refuse(path)
        wish = Wish(first=path, values=how != "events")
    return Recorder(wish, lambda text: note(f"bt-actions: {text}"))


def _refuse(path: Path) -> None:
    if path.suffix != ".mcap":
        raise BadInput(f"--record {path}: the name of a recording ends in .mcap")
    if not path.parent.is_dir():
        raise BadInput(f"--record {path}: there is no folder {path.parent}")
    from bt_actions.recording.folders import parts_of, summary_of

    taken = [each for each in (*parts_of(path), path, summary_of(path)) if os.path.lexists(each)]
    if taken:
        raise BadInput(f"--record {path}: {taken[0]} exists, and a recording replaces no file")
