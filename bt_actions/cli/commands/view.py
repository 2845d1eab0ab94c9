"""`bt-actions view`: a page that shows recorded runs, live while they go on."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import number
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions view                                # the run that goes on, else the last one
  bt-actions view pick_and_place --open          # the last run of a tree, in the browser
  bt-actions view 96399112                       # the first letters of an id: `bt-actions runs`
  bt-actions view monday.mcap
from another computer:
  ssh -L 8650:127.0.0.1:8650 ROBOT bt-actions view

The page reads recordings, and only reads: it cannot pause or halt a run. A run goes on as if nobody
looked. Ctrl-C stops the page's server.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "view",
        help="show a run on a page, live or from its recording",
        description="Serve a page, to browsers of this computer alone, that shows a run: what runs "
        "and waits, why it failed, and all that happened. Its address is the one line of output.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "run",
        metavar="RUN",
        nargs="?",
        default="",
        help="first letters of an id, name of a tree, .mcap file, or folder of a bag",
    )
    parser.add_argument(
        "--port",
        metavar="N",
        type=number("port: 1 to 65535", int, 1, 65535),
        help="port on 127.0.0.1 [8650, or the next free one]",
    )
    parser.add_argument("--open", action="store_true", help="open the page in a browser, too")


def run(args: argparse.Namespace) -> int:
    """Serve the page until somebody stops it."""
    from bt_actions.recording.folders import NoRun, find

    try:
        from bt_actions.page import server
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in ("starlette", "uvicorn"):
            raise
        remedy = "pip install 'bt_actions[view]'"
        raise BadInput(f"the page needs {missing}, which is not installed: {remedy}") from error
    try:
        given = find(args.run) if args.run else None
        opened = server.listen(args.port)
    except NoRun as error:
        raise BadInput(str(error)) from error
    except server.NoPort as error:
        raise BadInput(f"{error}: give another one with --port") from error
    address = server.address(opened, given)
    write(f"{address}\n")
    if args.open:
        import webbrowser

        webbrowser.open(address)
    server.server_of(given).run(sockets=[opened])
    return Exit.SUCCESS
