"""`bt-actions runs`: the runs that this user has recorded, the newest first.

Reads summaries alone, and no events.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.results import results
from bt_actions.cli.streams.writing import columns, note, write
from bt_actions.utilities.plain_text import as_json
from bt_actions.utilities.shorten import fit

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.recording.folders import Recorded

_EPILOG = """\
examples:
  bt-actions runs
  bt-actions runs --failed --tree pick_and_place
  bt-actions runs --json | jq -r 'select(.failed) | .run'
  bt-actions runs prune          # keeps the last 20 that went well, and the last 100 others
  bt-actions runs prune --all    # keeps what is being written

`bt-actions report RUN` tells one of them.
"""
_LEAST = 40
"""Columns that a cause needs; where there are fewer, the cause has a line of its own."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "runs",
        help="list recorded runs",
        description="List the recorded runs of this user on this machine, the newest first.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "wish",
        metavar="prune",
        nargs="?",
        choices=("prune",),
        help="remove the oldest recordings, and name them",
    )
    parser.add_argument("--all", action="store_true", help="with prune: remove all recordings")
    parser.add_argument(
        "--failed", action="store_true", help="list only runs that failed or never finished"
    )
    parser.add_argument(
        "--tree", metavar="NAME", default="", help="list only the runs of this tree"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def run(args: argparse.Namespace) -> int:
    """List the runs, or remove some."""
    from bt_actions.recording.folders import home, prune, recorded

    if args.wish is None and args.all:
        raise BadInput("--all is for `bt-actions runs prune`")
    if args.wish is not None and (args.failed or args.tree):
        raise BadInput("prune removes the oldest runs, whatever --failed or --tree say")
    if args.wish is not None:
        shown = prune(succeeded=0, failed=0) if args.all else prune()
    else:
        shown = [each for each in recorded() if _is_meant(each, args)]
    if args.json:
        write("".join(f"{as_json(data(each))}\n" for each in shown))
    else:
        write("".join(f"{line}\n" for line in table(shown, columns(results()))))
    if args.wish is not None:
        note(f"bt-actions runs: {len(shown)} runs removed from {home()}")
    elif not shown:
        note(f"bt-actions runs: no such run is recorded in {home()}")
    else:
        _finish(shown)
    return Exit.SUCCESS


def _is_meant(run: Recorded, args: argparse.Namespace) -> bool:
    is_of_tree = args.tree in ("", run.summary.tree)
    return is_of_tree and (not args.failed or (run.summary.failed and not _goes_on(run)))


def _goes_on(run: Recorded) -> bool:
    return not run.summary.status and run.is_written


def data(run: Recorded) -> dict[str, object]:
    """Return a run's summary for JSON, without its events."""
    summary = run.summary
    return {
        "run": summary.run_id,
        "tree": summary.tree,
        "began": summary.began,
        "goes_on": _goes_on(run),
        "status": summary.status or None,
        "failed": summary.failed and not _goes_on(run),
        "stopped_by": summary.stopped_by or None,
        "exit_code": summary.exit_code,
        "seconds": summary.seconds,
        "cause": summary.cause or None,
        "goal": summary.request or None,
        "caller": summary.caller or None,
        "where": dict(summary.where),
        "path": str(run.first),
    }


def table(runs: Iterable[Recorded], width: int) -> list[str]:
    """Return a line for each run under a head; a cause that has no room stands below its run."""
    rows = [_row(each) for each in runs]
    if not rows:
        return []
    rows.insert(0, ("run", "began", "tree", "status", "seconds", "why"))
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    room = width - sum(widths) - 2 * len(widths)
    lines = []
    for row in rows:
        cells = [cell.ljust(size) for cell, size in zip(row[:4], widths, strict=False)]
        line = "  ".join([*cells, row[4].rjust(widths[4])])
        if not row[5] or room >= _LEAST:
            lines.append(f"{line}  {fit(row[5], room)}".rstrip()[:width])
        elif len(lines):
            lines += [line[:width], f"    {fit(row[5], max(_LEAST, width - 4))}"]
        else:
            lines.append(line[:width])
    return lines


def _row(run: Recorded) -> tuple[str, str, str, str, str, str]:
    summary = run.summary
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(summary.began))
    word = "STOPPED" if summary.status == "INVALID" else summary.status
    status = word or ("goes on" if run.is_written else "never finished")
    world = " in sim" if summary.is_simulated else ""
    seconds = "" if summary.seconds is None else fit(f"{summary.seconds:.2f}", 12)
    below = f"below {summary.caller[:8]}" if summary.caller else ""
    cause = ": ".join(filter(None, (below, summary.cause or summary.stopped_by)))
    return summary.run_id[:8], when, fit(summary.tree, 30), fit(status, 14) + world, seconds, cause


def _finish(runs: list[Recorded]) -> None:
    """Finish the recordings of killed processes, for other readers of these files."""
    left = [each for each in runs if not each.summary.status and not each.is_written]
    if not left:
        return
    from bt_actions.recording.finishing import finish_beside, is_finished

    with contextlib.suppress(OSError):
        open_ones = [each.first for each in left if not all(map(is_finished, each.parts))]
        finish_beside(*open_ones, may_wait=True)
