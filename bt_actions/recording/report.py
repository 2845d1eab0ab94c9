"""One text of a recorded run: its description, the cause of its failure, its actions, its events.

The runs below its failed leaves (RunTree) follow, as far as this machine has recorded
them.
"""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from bt_actions.recording.folders import Recorded, home, is_written, parts_of, recorded
from bt_actions.recording.reading import Recording, RecordingError
from bt_actions.recording.timeline import Line, Timeline
from bt_actions.story.state import State
from bt_actions.story.values import clock
from bt_actions.story.why import why
from bt_actions.story.words import action_table, left_open, troubles, verdict_on
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import MESSAGE, brief, fit, shorten

FIRST, LAST = 50, 150
"""Lines of a long run that are kept: from its beginning, and from its end."""
LEVELS = 8
"""Runs that are told at most, each below a leaf of the one before."""
TICK = 0.1
"""Seconds of a tick from which on it is told, when its process was killed."""
_PLACE = ("node", "domain", "host")


@dataclass(frozen=True, slots=True)
class Report:
    """The report on one run."""

    recording: Recording
    """The recording, read to its end."""
    state: State
    """The state behind the last event."""
    begins: tuple[Line, ...]
    ends: tuple[Line, ...]
    left_out: int
    """Lines between these."""
    lost: int
    """Events that are missing in the recording."""
    goes_on: bool
    values: bool
    leaf: str = ""
    """The RunTree leaf, of the report before, whose goal the run answers."""

    def lines(self, *, full: bool = False) -> Iterator[Line | str]:
        """Yield the lines of the run, and a text in place of left-out ones. Raises RecordingError.

        All of it is read anew, so that a run of any length takes little memory.
        """
        if full and self.left_out:
            yield from Timeline(Recording(self.recording.first), values=self.values)
            return
        yield from self.begins
        if self.left_out:
            yield f"... {self.left_out} lines are left out here (--full has them)"
        yield from self.ends

    @property
    def is_over(self) -> bool:
        """Whether the run came to an end of its own."""
        return self.state.finished is not None or self.state.ended is not None

    @property
    def lived(self) -> float:
        """Seconds from the run's beginning until the last sign of life of its process."""
        beat, began = self.recording.last_beat, self.state.began
        assert began is not None
        return max(self.state.elapsed, 0.0 if beat is None else beat - began.at.wall)

    @property
    def files(self) -> list[str]:
        """The tree files; without values, their names alone."""
        paths = list(self.recording.sources)
        return paths if self.values else sorted({path.rpartition("/")[2] for path in paths})

    @property
    def ending(self) -> str:
        """The end of the run, in a few words."""
        state = self.state
        if not self.is_over:
            return "goes on" if self.goes_on else "never finished"
        cause = f", {state.ended.cause}" if state.ended is not None and state.ended.cause else ""
        return clean(f"{verdict_on(state)}{cause}")


def reports(first: Path, *, values: bool = True, where: Path | None = None) -> list[Report]:
    """Read a run, and those that ran below its failed RunTree leaves, in the order of the levels.

    Args:
        first: the run's first file.
        values: whether goals, results and other values of the robot's are told.
        where: the folder of recorded runs in which those below are looked for.

    Raises RecordingError.
    """
    found = [_read(first, values)]
    below = {each.summary.request: each for each in _beside(first, where) if each.summary.request}
    for above in found:  # the list grows
        for goal_id, leaf in _asked(above.state):
            run: Recorded | None = below.pop(goal_id, None)
            if run is not None and len(found) < LEVELS:
                try:
                    found.append(_read(run.first, values, leaf))
                except RecordingError:  # the leaf above has told its end
                    continue
    return found


def caller_of(report: Report, where: Path | None = None) -> Path | None:
    """Return the first file of the run whose leaf asked for a run, where this machine has it."""
    caller = report.state.began.caller if report.state.began is not None else ""
    runs = _beside(report.recording.first, where) if caller else []
    return next((each.first for each in runs if each.summary.run_id == caller), None)


def _read(first: Path, values: bool, leaf: str = "") -> Report:
    timeline = Timeline(Recording(first), values=values)
    lines = iter(timeline)
    begins = tuple(itertools.islice(lines, FIRST))
    ends, count = deque[Line](maxlen=LAST), 0
    for line in lines:
        ends.append(line)
        count += 1
    if timeline.state.began is None:
        damage = timeline.recording.damage
        raise RecordingError(f"{first} holds no run{f': {damage}' if damage else ''}")
    goes_on = is_written(first) and timeline.state.ended is None
    left_out = count - len(ends)
    return Report(
        timeline.recording,
        timeline.state,
        begins,
        tuple(ends),
        left_out,
        timeline.lost,
        goes_on,
        values,
        leaf,
    )


def _beside(first: Path, where: Path | None) -> list[Recorded]:
    """Return the recorded runs among which those below a run may be."""
    folders = {home() if where is None else where, first.absolute().parent.parent}
    return [each for folder in folders for each in recorded(folder)]


def _asked(state: State) -> Iterator[tuple[str, str]]:
    """Yield the goal and the name of each RunTree leaf that failed, was stopped, or runs."""
    failed = [each.action for each in (*state.failures, *state.stopped, *state.dealt_with)]
    for action in (*failed, *state.live):
        if action is not None and action.node.action == "RunTree" and action.latest is not None:
            yield action.latest.latest.goal_id, " / ".join(action.path)


# As a text


def text(found: Iterable[Report], *, full: bool = False, width: int = MESSAGE) -> Iterator[str]:
    """Yield the lines of reports for a terminal."""
    for number, report in enumerate(found):
        yield from [""] if number else []
        yield title(report)
        for name, lines in _sections(report, full, width):
            yield from ["", name] if name else []
            yield from (f"  {line}" for line in lines)


def markdown(found: Iterable[Report], *, full: bool = False) -> Iterator[str]:
    """Yield the lines of reports as Markdown; no text in them can become Markdown or HTML."""
    for number, report in enumerate(found):
        yield from [""] if number else []
        yield f"{'##' if number else '#'} {_code(title(report))}"
        for name, lines in _sections(report, full, MESSAGE):
            yield from ["", f"**{name}**"] if name else []
            yield from ["", "```text"]
            yield from (line.replace("```", "'''") for line in lines)
            yield "```"


def title(report: Report) -> str:
    """Say which run it is, and how it ended."""
    below = f"below {report.leaf}: " if report.leaf else ""
    return clean(f"{below}{report.state.tree}: {report.ending}")


def _code(line: str) -> str:
    return f"`{line.replace('`', chr(39))}`"


def _sections(report: Report, full: bool, width: int) -> Iterator[tuple[str, Iterable[str]]]:
    yield "", [fit(clean(line)) for line in _head(report)]
    if reasons := list(_why(report)):
        yield "why", reasons
    if report.state.actions:
        yield "actions", map(clean, action_table(report.state, width))
    if report.begins:
        yield "what happened", map(str, report.lines(full=full))


def _head(report: Report) -> Iterator[str]:
    state, recording = report.state, report.recording
    began = state.began
    assert began is not None
    yield f"run {began.run_id}"
    when = time.strftime("%A %d %B %Y %H:%M:%S %z", time.localtime(began.at.wall))
    yield f"began {when}"
    if state.simulation:
        yield f"in a simulation: {state.simulation}"
    if place := [f"{key} {began.where[key]}" for key in _PLACE if key in began.where]:
        yield ", ".join(place)
    if began.caller or began.request:
        yield _asked_by(report)
    if began.inputs:
        words = ", ".join(f"{name}={shorten(value, 60)}" for name, value in began.inputs.items())
        yield f"inputs {words}"
    for name, value in state.outputs.items():
        yield f"output {name}: {brief(value)}"
    if began.versions:
        yield ", ".join(f"{name} {version}" for name, version in began.versions.items())
    if report.files:
        yield f"tree files {', '.join(report.files)}"
    if report.values:  # the name of a folder is private, too
        more = len(parts_of(recording.first)) - 1
        yield f"recorded in {recording.first}{f' and {more} more files' if more > 0 else ''}"
    if state.ended is not None and state.ended.world:
        yield state.ended.world
    if recording.damaged or report.lost:
        lost = f"{report.lost} event{' is' if report.lost == 1 else 's are'} missing"
        yield "; ".join(filter(None, [recording.damage, lost if report.lost else ""]))


def _asked_by(report: Report) -> str:
    began = report.state.began
    assert began is not None
    of = f" of run {began.caller}" if began.caller else ""
    return f"asked for by goal {began.request}{of}"


def _why(report: Report) -> Iterator[str]:
    state, lived = report.state, report.lived
    if report.is_over:
        yield from troubles(state)
        return
    if not report.goes_on:
        assert state.began is not None
        until = clock(state.began.at.wall + lived)
        tick = report.recording.tick
        stood = f"; its tick lasted for {tick:.1f} s then" if tick >= TICK else ""
        yield f"its process lived until {until}, {lived:.1f} s after the run began{stood}"
    if state.paused:
        yield "it was paused"
    waits = why(state, state.started + lived)
    then = "it runs:" if report.goes_on else "it then ran:"
    yield from [then, *(f"  {line}" for line in waits)] if waits else []
    if not report.goes_on:
        yield from left_open(state)
