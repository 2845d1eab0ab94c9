"""`bt-actions report`: the end of a recorded run and its cause, on the terminal or in a file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.driving.recorded import RUN, reading
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.results import results
from bt_actions.cli.streams.writing import columns, write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.recording.report import Report

_EPILOG = """\
examples:
  bt-actions report                              # the last run
  bt-actions report 96399112                     # the first letters of an id: `bt-actions runs`
  bt-actions report pick_and_place --full        # the last run of a tree, each line of it
  bt-actions report monday.mcap -o monday.md
  bt-actions report -o run.html                  # the page of `bt-actions view`, in one file
  bt-actions report -o issue.md --no-values      # for others: no goal, result, input or variable

The report adds the runs below a RunTree leaf that failed, where this machine has recorded them.
"""
_FORMS = (".md", ".json", ".html")


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "report",
        help="tell why a recorded run failed, and what happened in it",
        description="Tell why a recorded run failed, how its actions ended, and what happened.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "run",
        metavar="RUN",
        nargs="?",
        default="",
        help=f"{RUN} [the last]",
    )
    parser.add_argument("--full", action="store_true", help="print all lines of a long run")
    parser.add_argument(
        "--no-values",
        dest="values",
        action="store_false",
        help="leave out goals, results, inputs, variables, items and texts of log nodes",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=Path, help="file to write: .md, .json or .html"
    )


def run(args: argparse.Namespace) -> int:
    """Read the run, and tell it."""
    if args.output is not None and args.output.suffix not in _FORMS:
        raise BadInput(f"-o {args.output}: the name of a report ends in .md, .json or .html")
    from bt_actions.recording import report

    with reading(args.run) as recording:
        found = report.reports(recording.first, values=args.values)
        if not args.run:  # the last run is the one that a person has begun
            for _ in range(report.LEVELS):
                above = report.caller_of(found[0])
                if above is None:
                    break
                found = report.reports(above, values=args.values)
        if args.output is not None:
            _write(args.output, found, full=args.full)
        else:
            for line in report.text(found, full=args.full, width=columns(results()) - 2):
                write(f"{line}\n")
    return Exit.SUCCESS


def _write(path: Path, found: list[Report], *, full: bool) -> None:
    from bt_actions.recording.report import markdown
    from bt_actions.utilities.plain_text import as_json
    from bt_actions.utilities.whole_file import replace_file

    if path.suffix == ".md":
        text = "".join(f"{line}\n" for line in markdown(found, full=full))
    elif path.suffix == ".html":
        from bt_actions.page.report import page

        text = page(found)
    else:
        text = as_json({"runs": [data(each, full=full) for each in found]}, ascii_only=True) + "\n"
    try:
        replace_file(path, text.encode())
    except OSError as error:
        raise BadInput(f"{path} cannot be written: {error.strerror}") from error


def data(report: Report, *, full: bool) -> dict[str, object]:
    """Return a report as plain data; docs/recording.md tells what its keys are."""
    from bt_actions.cli.views.json_lines import action_data, plain
    from bt_actions.recording.timeline import Line
    from bt_actions.story.why import why

    state, recording = report.state, report.recording
    began, ended = state.began, state.ended
    assert began is not None
    lines = [each for each in report.lines(full=full) if isinstance(each, Line)]
    return {
        "run": began.run_id,
        "tree": began.tree,
        "below": report.leaf or None,
        "goal": began.request or None,
        "caller": began.caller or None,
        "where": dict(began.where),
        "began": began.at.wall,
        "seconds": round(state.elapsed, 3),
        "goes_on": report.goes_on,
        "status": state.status.value if report.is_over else None,
        "exit_code": ended.exit_code if ended is not None else None,
        "lived": round(report.lived, 3),
        "tick": recording.tick,
        "inputs": plain(began.inputs),
        "outputs": plain(state.outputs),
        "versions": dict(began.versions),
        "files": sorted(report.files),
        "why": why(state, state.started + report.lived),
        "actions": [action_data(each, state.latest) for each in state.actions],
        "damaged": recording.damaged,
        "lost": report.lost,
        "left_out": 0 if full else report.left_out,
        "timeline": [
            {
                "seconds": round(each.seconds, 4),
                "wall": each.at.wall,
                "kind": each.kind,
                "text": each.text,
                "id": each.node,
                "path": list(each.path),
            }
            for each in lines
        ],
    }
