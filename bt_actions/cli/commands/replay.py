"""`bt-actions replay RUN`: a recorded run again, forwards and backwards, at any speed."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import add_option, number
from bt_actions.cli.driving.recorded import RUN, progress, reading
from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.results import keep_results_apart, results
from bt_actions.cli.streams.writing import OutputLost, terminal

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.cli.views.view import View
    from bt_actions.recording.reading import Recording
    from bt_actions.recording.tape import Tape
    from bt_actions.story.state import State

_EPILOG = """\
examples:
  bt-actions replay
  bt-actions replay pick_and_place --speed 10
  bt-actions replay 3f2a
  bt-actions replay /data/runs/monday.mcap --json | jq 'select(.event == "goal")'

keys:
  space         pause, go on; at the end: from the beginning
  left, right   5 s back, 5 s on
  down, up      1 min back, 1 min on
  , .           one event back, one on
  n N           to the next failure, to the one before
  + -           faster, slower: 1, 2, 5, 10, 100 times
  q, Ctrl-C     end

Where standard input or output is no terminal, `replay` prints the whole run at once, as lines.
Exit codes: 0, or 2 for a run that does not exist or cannot be read; 130 after Ctrl-C.
"""
FRAME = 0.1
"""Seconds between two drawings."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "replay",
        help="play a recorded run again",
        description="Play a recorded run in the terminal, drawn as `bt-actions run` draws it.",
        epilog=_EPILOG,
    )
    parser.add_argument("run", metavar="RUN", nargs="?", default="", help=f"{RUN} [the last]")
    parser.add_argument(
        "--speed",
        metavar="N",
        type=number("factor from 0.01 to 1000", least=0.01, most=1000.0),
        default=1.0,
        help="how many times as fast as the run was (default: 1)",
    )
    add_option(parser, "--json", help="write the run at once, one JSON object a line, as run does")
    parser.add_argument("--plain", action="store_true", help="lines at once, in a terminal, too")
    parser.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="among lines, write one for every state of every goal",
    )


def run(args: argparse.Namespace) -> int:
    """Show the run that `args` name."""
    if args.json:
        keep_results_apart()
    takes_keys = sys.stdin is not None and sys.stdin.isatty()
    console = terminal() if takes_keys and not (args.json or args.plain) else None
    with reading(args.run) as recording:
        if console is None:
            return _write(recording, _views(args))
        from bt_actions.recording.tape import Tape

        with progress("events read") as count:
            tape = Tape(recording, count)
        return _play(tape, console, args.speed)


# Played


def _play(tape: Tape, console: Console, speed: float) -> int:
    from bt_actions.cli.driving.player import Player
    from bt_actions.cli.driving.signals import Signals
    from bt_actions.cli.streams.keys import Keys
    from bt_actions.cli.views.played import PlayedView

    player = Player(tape, speed)
    with Signals() as signals, Keys(sys.stdin.fileno()) as keys:
        view = PlayedView(console)
        try:
            drawn = time.monotonic()
            while True:
                view.show(player)
                received, ready = signals.wait(FRAME, readable=keys.fileno)
                if received:
                    return Exit[received[0].name]
                before, drawn = drawn, time.monotonic()
                player.let_pass(drawn - before)
                for key in keys.read() if keys.fileno in ready else ():
                    if key == "q":
                        return Exit.SUCCESS
                    player.press(key)
        except (OSError, EOFError):  # the terminal is gone
            return Exit.SIGHUP
        finally:
            with contextlib.suppress(OSError):
                view.close()


# Written


def _views(args: argparse.Namespace) -> Callable[[State], View]:
    from bt_actions.cli.views.json_lines import JsonView
    from bt_actions.cli.views.lines import LineView

    if args.json:
        return lambda state: JsonView(state, results())
    return lambda state: LineView(state, sys.stdout, verbose=args.verbose)


def _write(recording: Recording, view: Callable[[State], View]) -> int:
    """Write the run as a whole."""
    from bt_actions.cli.driving.feed import Feed
    from bt_actions.events import EventsLost
    from bt_actions.recording.folders import is_written
    from bt_actions.recording.reading import RecordingError
    from bt_actions.story.state import State

    feed = Feed(state := State(), view(state))
    try:
        for item in recording.items():
            if isinstance(item, State):
                feed = Feed(item, view(item))
                continue
            feed.event(item)
            if isinstance(item, EventsLost):
                feed.view.say(f"{item.count} events are missing here")
        if feed.state.began is None:
            raise RecordingError(f"{recording.first} holds no run")
        if feed.state.ended is None:
            why = "the run goes on" if is_written(recording.first) else "its process was killed"
            feed.view.say(f"the recording ends here: {why}")
        feed.view.finish()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputLost(error) from error
    return Exit.SUCCESS
