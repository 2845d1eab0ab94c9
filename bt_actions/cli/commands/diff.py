"""`bt-actions diff RUN RUN`: the first node at which two runs of a tree part, with the values."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from itertools import zip_longest
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.options import number
from bt_actions.cli.driving.recorded import RUN, reading
from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import write
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import fit, shorten

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers
    from bt_actions.events import RunBegan
    from bt_actions.recording.comparing import Parting, Places, Walk

_EPILOG = """\
examples:
  bt-actions diff 3f2a 9c41
  bt-actions diff monday.mcap pick_and_place
  bt-actions diff --tolerance 0.05 3f2a 9c41

`diff` compares for each node the ends of its visits in their order (SUCCESS, FAILURE, stopped), of
an action also its goals with outcomes and results, of a loop its rounds and items. Times, ids,
feedback and the interleaving of parallel branches are no difference.

exit codes:
  0 the runs do not part   1 they part   2 a run does not exist, or the runs are of two trees
"""
_LETTERS = ("A", "B")


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "diff",
        help="show where two runs of a tree part",
        description="Show the first node at which two recorded runs of a tree part.",
        epilog=_EPILOG,
    )
    parser.add_argument("a", metavar="RUN", help=RUN)
    parser.add_argument("b", metavar="RUN", help="the other run")
    parser.add_argument(
        "--tolerance",
        metavar="N",
        type=number("number from 0 on", least=0.0),
        default=0.01,
        help="by how much numbers of goals and results may differ, in their unit or as a share of "
        "the greater one (default: 0.01)",
    )


def run(args: argparse.Namespace) -> int:
    """Compare the runs that `args` name."""
    from bt_actions.recording.comparing import Places, parting

    places = Places()
    (a, last_a), (b, last_b) = _walk(args.a, places), _walk(args.b, places)
    walks = a, b
    begins = _began(walks[0]), _began(walks[1])
    if begins[0].tree != begins[1].tree:
        names = " and ".join(clean(each.tree) for each in begins)
        raise BadInput(f"these are runs of two trees, {names}: runs of one tree are compared")
    found = parting(walks, places, args.tolerance)
    lines = [*map(_head, _LETTERS, walks), *_where(*begins), *_inputs(*begins), *_files(*begins)]
    lines += _parting(found, places, (last_a, last_b)) if found is not None else _same(walks[0])
    write("".join(f"{fit(clean(line))}\n" for line in lines))
    return Exit.SUCCESS if found is None else Exit.FAILURE


def _walk(run: str, places: Places) -> tuple[Walk, str]:
    """Return the steps of a run, and the reason where more should follow."""
    from bt_actions.recording.comparing import Walk
    from bt_actions.recording.folders import is_written
    from bt_actions.recording.reading import RecordingError

    with reading(run) as recording:
        walk = Walk(recording.items(), places)
        if walk.state.began is None:
            raise RecordingError(f"{recording.first} holds no run")
        if walk.state.finished is not None or walk.state.ended is not None:
            return walk, "no further outcome"
        if is_written(recording.first):
            return walk, "nothing yet: the run goes on"
        return walk, "nothing more: its process was killed"


def _began(walk: Walk) -> RunBegan:
    assert walk.state.began is not None
    return walk.state.began


def _head(letter: str, walk: Walk) -> str:
    from bt_actions.story.words import verdict_on

    state, began = walk.state, _began(walk)
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(began.at.wall))
    lost = f"; {walk.lost} events are not in the recording" if walk.lost else ""
    return "  ".join((letter, began.run_id[:8], began.tree, when, verdict_on(state) + lost))


def _where(a: RunBegan, b: RunBegan) -> Iterator[str]:
    for name in sorted(a.where.keys() | b.where.keys()):
        one, other = (each.where.get(name, "none") for each in (a, b))
        if one != other:
            yield f"{name}: {_both(one, other)}"


def _inputs(a: RunBegan, b: RunBegan) -> Iterator[str]:
    from bt_actions.events.snapshot import HIDDEN

    for name in sorted(a.inputs.keys() | b.inputs.keys()):
        values = [each.inputs.get(name, "not there") for each in (a, b)]
        if HIDDEN not in values and repr(values[0]) != repr(values[1]):  # NaN is like NaN
            yield f"input {name}: {_both(*(shorten(each, 100) for each in values))}"


def _files(a: RunBegan, b: RunBegan) -> Iterator[str]:
    """Tell which tree files differ; a file that only lies elsewhere does not."""
    shared = set(a.sources.values()) & set(b.sources.values())
    for path in sorted(a.sources.keys() | b.sources.keys()):
        one, other = a.sources.get(path), b.sources.get(path)
        if one is not None and other is not None:
            lines = zip_longest(one.splitlines(), other.splitlines(), fillvalue="")
            for number, (left, right) in enumerate(lines, 1):
                if left != right:
                    yield f"file {path}, line {number}: {_both(left.strip(), right.strip())}"
                    break
        elif not shared.intersection((one, other)):
            yield f"file {path}: only {_LETTERS[one is None]} has read it"


def _both(one: str, other: str) -> str:
    return f"A {fit(one, 100)} | B {fit(other, 100)}"


def _parting(found: Parting, places: Places, ends: tuple[str, str]) -> Iterator[str]:
    if found.last is None:
        yield "the same up to there: nothing"
    else:
        where = " / ".join(places.path(found.last.place))
        last = f"the last of {where}: {found.last.text}"
        yield f"the same up to there: {found.common} outcomes, {last}"
    yield f"the runs part at {' / '.join(found.path)}"
    for letter, step, end in zip(_LETTERS, found.sides, ends, strict=True):
        told = end if step is None else f"{step.seconds:.2f} s  {step.text}"
        yield f"  {letter}  {told}"


def _same(walk: Walk) -> list[str]:
    return [f"the runs do not part: {len(walk.steps)} outcomes are the same"]
