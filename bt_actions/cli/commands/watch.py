"""`bt-actions watch`: the runs that go on, in a terminal: their waits, and causes of failures."""

from __future__ import annotations

import argparse
import contextlib
import time
from typing import TYPE_CHECKING

from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.writing import terminal, write

if TYPE_CHECKING:
    from collections.abc import Callable

    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.cli.views.watched import WatchedLines, WatchedScreen
    from bt_actions.recording.folders import Summary

_EPILOG = """\
examples:
  bt-actions watch                          # all runs of this user on this computer
  bt-actions watch pick_and_place           # runs of one tree
  bt-actions watch 3f2a                     # the run whose id begins with 3f2a
  ssh -t ROBOT bt-actions watch
  bt-actions watch | grep FAILURE           # in a pipe, a line for each change

`watch` shows the recorded runs of all terminals, and names runs without a recording. `bt-actions
view` shows more of a run, in a browser.
Exit codes: 130 after Ctrl-C, 143 after SIGTERM, 141 after the reader has closed the pipe.
"""
FRAME = 0.2
"""Seconds between two looks."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "watch",
        help="watch the runs that go on, in a terminal",
        description="Show what each running tree does and waits for, and the status and cause at "
        "its end, until Ctrl-C.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "name",
        metavar="NAME",
        nargs="?",
        default="",
        help="show only the runs of this tree, or the run whose id begins with NAME",
    )
    parser.add_argument(
        "--plain", action="store_true", help="print a line for each change in a terminal, too"
    )


def run(args: argparse.Namespace) -> int:
    """Tell of the runs until a signal comes."""
    from bt_actions.cli.driving.drive import pipe_of_stdout
    from bt_actions.cli.driving.signals import Signals
    from bt_actions.recording.watching import Watch

    watch, reader = Watch(_meant(args.name)), pipe_of_stdout()
    with Signals() as signals, contextlib.closing(watch):
        runs = watch.look()
        with contextlib.closing(_view(args, "" if runs else _last(args.name))) as view:
            while True:
                view.show(runs)
                received, ready = signals.wait(FRAME, writable=reader)
                if received:
                    return Exit[received[0].name]
                if ready:
                    return Exit.SIGPIPE
                runs = watch.look()


def _meant(name: str) -> Callable[[Summary], bool]:
    return lambda run: not name or run.tree == name or run.run_id.startswith(name.lower())


def _last(name: str) -> str:
    """Say how the last run ended, where there was one."""
    from bt_actions.recording.folders import recorded

    run = next((each.summary for each in recorded() if _meant(name)(each.summary)), None)
    if run is None:
        return f"and no run of {name} is recorded" if name else ""
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(run.began))
    status = "STOPPED" if run.status == "INVALID" else run.status or "never finished"
    cause = f": {run.cause}" if run.cause else ""
    return f"the last: {run.tree}  {run.run_id[:8]}  {when}  {status}{cause}"


def _view(args: argparse.Namespace, last: str) -> WatchedLines | WatchedScreen:
    from bt_actions.cli.views.watched import NOTHING, WatchedLines, WatchedScreen

    if not args.plain and (console := terminal()) is not None:
        return WatchedScreen(console, last)
    if last:
        write(f"{NOTHING}; {last}\n")
    return WatchedLines()
