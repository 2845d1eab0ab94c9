"""Two runs of a tree, compared: where they part first.

The outcomes of each node are compared in their order: of its visits, attempts and rounds. So
branches of a parallel may interleave in any way. Times, ids and feedback do not count, and neither
does the number of equal outcomes of a node in a row: a condition is asked in each tick. A value
that was not kept equals any other.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from typing import NamedTuple

from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    Cut,
    Event,
    EventsLost,
    GoalChanged,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    RoundBegan,
    RunBegan,
    TreeFinished,
)
from bt_actions.events.snapshot import HIDDEN, Value
from bt_actions.goals.policy import End, Outcome
from bt_actions.recording.reading import Item, RecordingError
from bt_actions.story.state import OVER, State
from bt_actions.story.values import opened
from bt_actions.story.why import attempt_text
from bt_actions.utilities.shorten import shorten

MOST = 1_000_000
"""Outcomes of one run that are compared."""


class Step(NamedTuple):
    """One outcome in a run."""

    number: int
    """The number of its event."""
    seconds: float
    """Seconds since the run began."""
    place: int
    value: Value
    """The value for the comparison."""
    text: str
    """The same in words, with its details."""


class Places:
    """The numbers of places in a tree, the same in each run.

    By names, not by the nodes' numbers.
    """

    def __init__(self) -> None:
        self._numbers: dict[tuple[int, str], int] = {}
        self._held = [(0, "")]
        """The holder of each place, and its name."""

    def of(self, state: State) -> dict[int, int]:
        """Return the place of each node; later siblings of one name are counted."""
        places, seen = dict[int, int](), Counter[tuple[int, str]]()
        for key, story in state.nodes.items():
            held = places.get(story.node.parent or 0, 0), story.node.name
            seen[held] += 1
            if seen[held] > 1:
                held = held[0], f"{held[1]} ({seen[held]})"
            if held not in self._numbers:
                self._numbers[held] = len(self._held)
                self._held.append(held)
            places[key] = self._numbers[held]
        return places

    def path(self, place: int) -> tuple[str, ...]:
        """Return the names from the root down to a place."""
        names = list[str]()
        while place:
            place, name = self._held[place]
            names.append(name)
        return tuple(reversed(names))


class Walk:
    """The outcomes of a run, in their order."""

    def __init__(self, items: Iterable[Item], places: Places) -> None:
        """Read all outcomes. Raises RecordingError."""
        self.state = State()
        """The state of the run at the end of its recording."""
        self.steps: list[Step] = []
        self.lost = 0
        """Events that are missing in the recording."""
        self._place: dict[int, int] = {}
        self._last: dict[int, Value] = {}
        """The latest outcome by place."""
        for item in items:
            if isinstance(item, State):
                self.state = item
            else:
                node = getattr(item, "node", None)
                before = self.state.status_of(node) if isinstance(node, int) else Status.INVALID
                self.state.fold(item)
                if node is None or node in self._place:
                    self._take(item, before)
            if isinstance(item, State | RunBegan | NodesAdded | NodesRemoved):
                self._place = places.of(self.state)
            if len(self.steps) > MOST:
                raise RecordingError(f"a run of more than {MOST} outcomes is too long to compare")

    def _take(self, event: Event, before: Status) -> None:
        match event:
            case NodeChanged(status=status) if status in OVER:
                said = f": {event.message}" if event.message else ""
                self._add(event, event.node, (status.value,), f"{status.value}{said}")
            case NodeChanged(status=Status.INVALID) if before is Status.RUNNING:
                self._add(event, event.node, ("stopped",), "is stopped")
            case GoalChanged(state="SENDING"):
                sent = shorten(opened(event.goal)) if event.goal is not None else "a goal"
                told = f"attempt {event.attempt}: sends {sent}"
                self._add(event, event.node, ("sends", event.attempt, event.goal), told)
            case AttemptEnded():
                self._attempt(event)
            case RoundBegan():
                of = f" of {event.of}" if event.of is not None else ""
                item = f": {shorten(event.item)}" if event.item is not None else ""
                told = f"begins round {event.number + 1}{of}{item}"
                self._add(event, event.node, (event.number, event.of, event.item), told)
            case TreeFinished(outputs=outputs) if outputs and self.state.nodes:
                told = f"gives {shorten(outputs)}"
                self._add(event, self.state.root, ("gives", dict(outputs)), told)
            case EventsLost():
                self.lost += event.count

    def _attempt(self, event: AttemptEnded) -> None:
        action = self.state.action(event.node)
        goal = action.goals.get(event.goal_id)
        text, result = str(event.outcome), None
        if goal is not None:
            text = attempt_text(action, goal)
            result = goal.result if goal.latest.end is not End.CANCELED else None  # else it varies
            if goal.outcome is Outcome.SUCCEEDED and result is not None:
                text += f"; result {shorten(opened(result))}"
        value = ("ends", event.attempt, str(event.outcome), result)
        self._add(event, event.node, value, f"attempt {event.attempt}: {text}")

    def _add(self, event: Event, node: int, value: Value, text: str) -> None:
        place = self._place[node]
        if self._last.get(place) == value:
            return
        self._last[place] = value
        if self.state.acts(node) and (visits := self.state.action(node).visits) > 1:
            text = f"visit {visits}, {text}"
        seconds = round(event.at.steady - self.state.started, 6)  # as exact as recordings are
        self.steps.append(Step(event.at.number, seconds, place, value, text))


@dataclass(frozen=True, slots=True)
class Parting:
    """The earliest difference of two runs."""

    path: tuple[str, ...]
    """The path of the node."""
    sides: tuple[Step | None, Step | None]
    """The outcome of either run there; None for a run with no further outcome there."""
    common: int
    """Equal outcomes before it."""
    last: Step | None
    """The last of these."""


def parting(walks: tuple[Walk, Walk], places: Places, tolerance: float) -> Parting | None:
    """Return where two runs part, or None; numbers differ by more than `tolerance`.

    `tolerance` is both an absolute difference and one relative to the greater number.
    """
    by_place = tuple(_by_place(walk) for walk in walks)
    found: list[tuple[float, int, int, Step | None, Step | None]] = []
    for place in by_place[0].keys() | by_place[1].keys():
        for sides in zip_longest(by_place[0][place], by_place[1][place]):
            a, b = sides
            if a is None or b is None or not alike(a.value, b.value, tolerance):
                seconds, number, side = min(
                    (each.seconds, each.number, which)
                    for which, each in enumerate(sides)
                    if each is not None
                )
                found.append((seconds, number, side, a, b))
                break
    if not found:
        return None
    _, number, side, a, b = min(found, key=lambda each: each[:3])
    before = [each for each in walks[side].steps if each.number < number]
    first = a or b
    assert first is not None
    return Parting(places.path(first.place), (a, b), len(before), before[-1] if before else None)


def _by_place(walk: Walk) -> defaultdict[int, list[Step]]:
    steps = defaultdict[int, list[Step]](list)
    for step in walk.steps:
        steps[step.place].append(step)
    return steps


def alike(a: Value, b: Value, tolerance: float) -> bool:
    """Return whether two values are equal, as far as is known, within the tolerance."""
    waiting = [(a, b)]
    while waiting:
        a, b = waiting.pop()
        if a in (None, HIDDEN) or b in (None, HIDDEN):
            continue
        if isinstance(a, Cut) and isinstance(b, Cut):
            waiting.append(((a.head, a.more), (b.head, b.more)))
        elif isinstance(a, Mapping) and isinstance(b, Mapping) and a.keys() == b.keys():
            waiting += [(each, b[key]) for key, each in a.items()]
        elif isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            waiting += zip(a, b, strict=True)
        elif isinstance(a, float) and isinstance(b, float):
            is_near = math.isclose(a, b, rel_tol=tolerance, abs_tol=tolerance)
            if not is_near and not (math.isnan(a) and math.isnan(b)):
                return False
        elif a != b:
            return False
    return True
