"""The commands put together: their parsers, their ends, and the words of an end for the user.

Nothing here knows what a command does.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import sys
import threading
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from bt_actions.cli.arguments.parser import Parser
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.results import give_stdout_back, results
from bt_actions.cli.streams.writing import OutputLost, discard_stdout, note, write
from bt_actions.ros.environment import Reach, prepare

COMMANDS = {
    "run": "run",
    "send": "send",
    "serve": "serve",
    "list": "list_trees",
    "call": "call",
    "control": "control",
    "watch": "watch",
    "runs": "runs",
    "report": "report",
    "replay": "replay",
    "diff": "diff",
    "stats": "stats",
    "view": "view",
    "sim": "sim",
    "cleanup": "cleanup",
    "check": "check",
    "interfaces": "interfaces",
    "explain": "explain",
    "format": "trees.format_trees",
    "import": "trees.import_trees",
    "schema": "schema",
    "render": "render",
}
"""The module of each command in `commands/`, in the order of --help."""

_EPILOG = """\
examples:
  bt-actions run pick_and_place --sim --speed 10
  bt-actions run trees/pick_and_place.yaml --set place_at=4.5 --timeout 60
  bt-actions send move_robot MoveRobot distance=2.0
  bt-actions check trees/*.yaml
  bt-actions render trees/pick_and_place.yaml -o tree.svg

exit codes:
  0 success   1 failure   2 bad input   3 the end of a goal is unknown (wins over all others)
  124 --timeout expired   129 SIGHUP   130 Ctrl-C   131 Ctrl-\\   141 closed stdout   143 SIGTERM
"""

START = 1.5
"""Seconds for which the garbage collector is left out."""


class _Version(argparse.Action):
    """The option for the version, which is looked up on demand: the look takes 20 ms."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        write(f"bt-actions {_version()}\n")
        parser.exit()


def build_parser(only: str = "") -> Parser:
    """Return the parser of every command, or of `only` one."""
    parser = Parser(
        prog="bt-actions",
        description="Run behaviour trees whose leaves are ROS 2 actions. A run tells how every "
        "goal ended, or that the end is not known; cleanup cancels the goals of a killed run.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="show program's version number and exit"
    )
    subparsers = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND")
    for name in [only] if only in COMMANDS else COMMANDS:
        _module(name).add_parser(subparsers)
    return parser


def _module(command: str) -> ModuleType:
    """Import the module of a command: no command waits for the imports of others."""
    return import_module(f"bt_actions.cli.commands.{COMMANDS[command]}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code. Bad input never shows a traceback to the user."""
    if "_ARGCOMPLETE" in os.environ:  # a shell asks what it may offer
        from bt_actions.cli.arguments.completing import complete

        complete(build_parser)
    if argv is None:
        _collect_later()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        code = _dispatch(argv)
    except BadInput as error:
        note(f"bt-actions: {error}" if error.prefixed else str(error))
        code = Exit.BAD_INPUT
    except OutputLost as error:
        note(f"bt-actions: {error}")
        discard_stdout()
        code = Exit.BAD_INPUT
    except ImportError as error:
        if error.name != "libyaml":
            raise
        note(f"bt-actions: {error}")
        code = Exit.BAD_INPUT
    except KeyboardInterrupt:
        code = Exit.SIGINT
    except BrokenPipeError:
        code = Exit.SIGPIPE
    code = code if _flushed() else code or Exit.BAD_INPUT
    if argv is not None:  # a calling program gets its standard output back
        give_stdout_back()
    return code


def _collect_later() -> None:
    """Leave the garbage collector out of the start, and what the start has made out of it.

    The imports of a run make some 90,000 objects that stay. To look through them again and again as
    they become more takes a tenth of the start's processor time.
    """

    def collect() -> None:
        gc.freeze()
        gc.enable()

    gc.disable()
    timer = threading.Timer(START, collect)
    timer.daemon = True
    timer.start()


def _dispatch(argv: Sequence[str] | None) -> int:
    arguments = sys.argv[1:] if argv is None else list(argv)
    parser = build_parser(arguments[0] if arguments else "")
    if not arguments:
        parser.print_help()
        return Exit.BAD_INPUT
    args = parser.parse(arguments)
    prepare(_reach(args))
    os.environ.pop("RCUTILS_LOGGING_USE_STDOUT", None)  # standard output is for results
    return int(_module(args.command).run(args))


def _reach(args: argparse.Namespace) -> Reach:
    if getattr(args, "sim", False) or getattr(args, "sim_like", None) is not None:
        return Reach.PROCESS
    return Reach.MACHINE if args.command == "sim" else Reach.NETWORK


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("bt_actions")
    except PackageNotFoundError:  # a checkout that is on the path without being installed
        return "(not installed)"


def _flushed() -> bool:
    """Flush standard output and error; report a failure, and return whether there is none.

    Python must not complain at exit of a reader that has gone.
    """
    note("", end="")  # and the same for what is left for standard error
    try:
        results().flush()
    except BrokenPipeError:
        discard_stdout()
    except (OSError, ValueError) as error:
        lost = OutputLost(error) if isinstance(error, OSError) else error
        note(f"bt-actions: {lost}")
        discard_stdout()
        return False
    return True
