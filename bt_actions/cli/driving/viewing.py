"""The page beside a command: with `--view` this user's view shows the runs of the command."""

from __future__ import annotations

import argparse
import importlib.util
import os

from bt_actions.cli.driving.record import VARIABLE
from bt_actions.cli.exits import BadInput
from bt_actions.cli.streams.writing import note


def add_option(parser: argparse.ArgumentParser) -> None:
    """Add `--view`."""
    parser.add_argument(
        "--view",
        action="store_true",
        help="print the address of this user's page; where no `bt-actions view` runs, one is "
        "started, which ends after ten minutes without a browser",
    )


def need_page() -> None:
    """Raise BadInput where the page's server is not installed."""
    for name in ("starlette", "uvicorn"):
        if importlib.util.find_spec(name) is None:
            remedy = "pip install 'bt_actions[view]'"
            raise BadInput(f"the page needs {name}, which is not installed: {remedy}")


def show(args: argparse.Namespace, shown: str = "") -> None:
    """Print the page's address where that is wanted; raise BadInput where there is no page."""
    if not args.view:
        return
    if args.no_record or args.record is not None or os.environ.get(VARIABLE) == "off":
        raise BadInput(
            "--view shows a recording in the usual folder: leave --no-record or --record away"
        )
    need_page()
    from bt_actions.page import standing

    try:
        note(f"look at it: {standing.opening(standing.shown(), shown)}")
    except OSError as error:
        raise BadInput(f"--view: {error}") from error
