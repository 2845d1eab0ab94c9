"""`bt-actions view`: a page that shows recorded runs, live while they go on."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import number
from bt_actions.cli.driving.viewing import need_page
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

NICE = 10
"""By how much less the page matters than the ticks of a run."""
_EPILOG = """\
examples:
  bt-actions view                                # the run that goes on, else the last one
  bt-actions view pick_and_place --open          # the last run of a tree, in the browser
  bt-actions view 96399112                       # the first letters of an id: `bt-actions runs`
  bt-actions view monday.mcap
from another computer:
  ssh -L 8650:127.0.0.1:8650 ROBOT bt-actions view --port 8650
  bt-actions view --host robot.example --certificate robot.pem    # on ROBOT, for the network

The page reads recordings, and cannot pause or halt a run. A run goes on as if nobody looked. The
address has a token: everybody with the address can see the runs of this user. Ctrl-C stops the
server of the page.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "view",
        help="show a run on a page, live or from its recording",
        description="Serve a page for browsers of this computer, which shows what a run does and "
        "waits for, why the run failed, and what happened. The command prints the address.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "run",
        metavar="RUN",
        nargs="?",
        default="",
        help="first letters of an id, name of a tree, .mcap file, or folder of a run or a bag",
    )
    parser.add_argument(
        "--port",
        metavar="N",
        type=number("port: 1 to 65535", int, 1, 65535),
        help="port [8650, or the next free one]",
    )
    parser.add_argument("--open", action="store_true", help="open the page in a browser, too")
    parser.add_argument(
        "--host",
        metavar="NAME",
        help="name or address under which other computers reach this one; needs --certificate",
    )
    parser.add_argument(
        "--certificate", metavar="FILE", type=Path, help="certificate of that host, as PEM"
    )
    parser.add_argument(
        "--key",
        metavar="FILE",
        type=Path,
        help="private key of the certificate, where FILE does not hold it",
    )


def run(args: argparse.Namespace) -> int:
    """Serve the page until a signal, or for as long as browsers look."""
    from bt_actions.recording.folders import NoRun, find

    need_page()
    from bt_actions.page import server, standing
    from bt_actions.page.guard import LOOPBACK, Place

    if (args.certificate is None) != (args.host is None):
        raise BadInput("--host and --certificate go together: the page leaves this computer by TLS")
    place = LOOPBACK if args.host is None else Place(args.host, args.certificate, args.key)
    try:
        given = find(args.run) if args.run else None
        opened = server.listen(args.port, place)
        served = server.server_of(given, place)
        address = server.address_of(opened, place)
        shown = standing.opening(address, "" if given is None else f"run={server.id_of(given)}")
        with standing.registered(address):
            write(f"{shown}\n")
            if args.open:
                import webbrowser

                webbrowser.open(shown)
            os.nice(NICE)
            served.run(sockets=[opened])
    except NoRun as error:
        raise BadInput(str(error)) from error
    except server.NoPort as error:
        raise BadInput(f"{error}: give another one with --port") from error
    except BrokenPipeError:
        raise
    except OSError as error:
        raise BadInput(f"the page cannot be served: {error}") from error
    return Exit.SUCCESS
