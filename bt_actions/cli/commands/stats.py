"""`bt-actions stats`: the successes and the durations of each action, over all runs."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import add_option
from bt_actions.cli.driving.recorded import progress
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import note, write
from bt_actions.utilities.plain_text import as_json, clean
from bt_actions.utilities.suggest import did_you_mean

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.recording.folders import Recorded
    from bt_actions.recording.statistics import Figures, Statistics

_EPILOG = """\
examples:
  bt-actions stats
  bt-actions stats --tree pick_and_place
  bt-actions stats --simulated
  bt-actions stats --json | jq '.actions[] | select(.success < 0.9) | .server'

`stats` counts the runs in the list of `bt-actions runs`, without runs in a simulation (`run --sim`,
`--sim-like`); with --simulated, only those. For each phase of a goal, p50 is the duration that half
of the goals did not exceed, and p95 the duration that 95 of 100 goals did not exceed.
Exit codes: 0, or 2 where no run is recorded.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "stats",
        help="print how the actions did over all recorded runs",
        description="Print for each action the goals, attempts, outcomes and the duration of each "
        "phase, over all recorded runs of this user.",
        epilog=_EPILOG,
    )
    parser.add_argument("--tree", metavar="NAME", default="", help="count only runs of this tree")
    parser.add_argument(
        "--simulated",
        action="store_true",
        help="count only runs in a simulation",
    )
    add_option(parser, "--json", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    """Count the runs that `args` name."""
    from bt_actions.recording.folders import home, recorded
    from bt_actions.recording.statistics import Statistics

    runs = recorded()
    if not runs:
        raise BadInput(f"no run is recorded yet in {home()}")
    meant = [each for each in runs if args.tree in ("", each.summary.tree)]
    if not meant:
        near = did_you_mean(args.tree, {each.summary.tree for each in runs})
        raise BadInput(f"no run of a tree {args.tree!r} is recorded{near}")
    of_tree = len(meant)
    meant = [each for each in meant if each.summary.is_simulated == args.simulated]
    statistics, counted, left_out = Statistics(), 0, of_tree - len(meant)
    with progress(f"of {len(meant)} runs read") as count:
        for number, each in enumerate(meant):
            count(number)
            counted += _add(statistics, each)
    actions = sorted(statistics.actions.items())
    if args.json:
        told = {"runs": counted, "left_out": left_out, "actions": [data(*each) for each in actions]}
        write(as_json(told) + "\n")
    else:
        lines = [line for each in actions for line in text(*each)]
        others = "in the world left out"
        if not args.simulated:
            others = "in a simulation left out (--simulated counts these alone)"
        more = f"; {left_out} {others}" if left_out else ""
        write("".join(f"{clean(line)}\n" for line in [_head(counted) + more, *lines]))
    return Exit.SUCCESS


def _add(statistics: Statistics, run: Recorded) -> bool:
    """Count one run; report the parts of it that cannot be read."""
    from bt_actions.recording.folders import held
    from bt_actions.recording.reading import Recording, RecordingError

    try:
        with held(run.first.parent, waits=True):
            recording = Recording(run.first)
            statistics.add(recording.items())
    except (RecordingError, OSError) as error:
        note(f"bt-actions stats: passed over: {clean(str(error))}")
        return False
    if recording.damaged:
        note(f"bt-actions stats: {run.first}: {recording.damage}")
    return True


def _head(runs: int) -> str:
    return f"{runs} run{'' if runs == 1 else 's'}"


def text(which: tuple[str, str], figures: Figures) -> Iterator[str]:
    """Yield the lines of one action."""
    from bt_actions.recording.statistics import PHASES

    success = "" if figures.success is None else f", {figures.success:.0%} succeeded"
    yield ""
    yield f"{which[0]} ({which[1]}), in {_head(figures.runs)}"
    yield f"  {figures.attempts} attempts, {figures.sent} goals sent{success}"
    if outcomes := figures.outcomes.most_common():
        yield f"  {', '.join(f'{outcome} {times}' for outcome, times in outcomes)}"
    phases = figures.phases
    if phases:
        yield f"  {'':<24}{'goals':>6}{'p50':>10}{'p95':>10}{'longest':>10}"
    for state, spread in phases.items():
        seconds = "".join(f"{each:>8.2f} s" for each in spread[1:])
        yield f"  {PHASES[state]:<24}{spread.goals:>6}{seconds}"


def data(which: tuple[str, str], figures: Figures) -> dict[str, object]:
    """Return the figures of one action as plain data."""
    return {
        "server": which[0],
        "type": which[1],
        "runs": figures.runs,
        "attempts": figures.attempts,
        "goals_sent": figures.sent,
        "success": figures.success,
        "outcomes": dict(figures.outcomes),
        "seconds": {state.lower(): spread._asdict() for state, spread in figures.phases.items()},
    }
