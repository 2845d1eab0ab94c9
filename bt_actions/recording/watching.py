"""The runs that go on now: each run of this user, what it waits for, and how it ended.

The watch follows the recordings. No time is made up: a clock stands where a run gives no sign of
life.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from py_trees.common import Status

from bt_actions.recording.folders import Recorded, Summary, is_written, parts_of, recorded
from bt_actions.recording.following import Follower
from bt_actions.recording.unrecorded import Unrecorded, unrecorded
from bt_actions.story.state import State
from bt_actions.story.values import clock
from bt_actions.story.why import why
from bt_actions.story.words import judged, left_open, troubles, verdict_on

STALE = 2.5
"""Seconds without a sign of life from which on a run counts as stale: two heartbeats."""
AHEAD = 1.2
"""Seconds for which a clock goes on behind a sign of life, at most."""
EACH = 1.0
"""Seconds between two looks for new runs."""
_LOOKS = {Status.SUCCESS: "success", Status.FAILURE: "failure", Status.INVALID: "stopped"}
KEPT = 60.0
"""Seconds for which an ended run is told."""


@dataclass(frozen=True, slots=True)
class Seen:
    """The standing of one run, in words."""

    summary: Summary
    word: str
    """``goes on``, ``FAILURE after 8.27 s``, ``Stale for 3 s``, ``Lost for 12 s``, ..."""
    look: str
    """running, waiting, success, failure, stopped or lost."""
    seconds: float
    """Seconds that it has run, as far as is known."""
    is_over: bool
    why: tuple[str, ...] = ()
    """The reasons why it waits, or has failed."""
    state: State = field(default_factory=State, compare=False)


class Watch:
    """The follower of all runs that are meant; close it in the end."""

    def __init__(self, is_meant: Callable[[Summary], bool] = lambda _: True) -> None:
        self._is_meant = is_meant
        self._runs: dict[Path, _Run] = {}
        self._known: set[Path] = set()
        self._looked = -math.inf
        self._unrecorded: dict[str, Unrecorded] = {}

    def look(self) -> list[Seen]:
        """Return the runs that go on, or have ended since the first look, ordered by name.

        A run that was over before the first look is left out.
        """
        now = time.monotonic()
        if now - self._looked >= EACH:
            self._find(is_first=self._looked < 0.0)
            self._looked = now
        for first, each in list(self._runs.items()):
            if each.ended is not None and now - each.ended > KEPT:
                del self._runs[first]
        seen = [each.look(self._unrecorded) for each in self._runs.values()]
        known = {each.summary.run_id for each in seen}
        for run_id, gap in self._unrecorded.items():
            if run_id not in known and self._is_meant(gap.summary):
                lasts = max(0.0, time.time() - gap.summary.began)
                words = f"not recorded since {gap}"
                seen.append(Seen(gap.summary, words, "stopped", lasts, is_over=False))
        return sorted(seen, key=lambda each: (each.summary.tree, each.summary.began))

    def _find(self, *, is_first: bool) -> None:
        """Follow the runs that have begun."""
        self._unrecorded = {each.summary.run_id: each for each in unrecorded()}
        for run in recorded():
            # A run that is beginning has its file for a moment before its lock.
            begins = not run.is_written and abs(time.time() - run.summary.began) < EACH
            if run.first in self._known or (begins and not is_first):
                continue
            self._known.add(run.first)
            if self._is_meant(run.summary) and (run.is_written or not is_first):
                with contextlib.suppress(OSError):  # another process removes it
                    self._runs[run.first] = _Run(run)

    def close(self) -> None:
        """Stop to follow all runs."""
        for each in self._runs.values():
            each.close()


class _Run:
    """One run that is followed until it is over."""

    def __init__(self, run: Recorded) -> None:
        self._summary, self._first = run.summary, run.first
        self._follower: Follower | None = Follower(run.first)
        self._state = State()
        self._last = Seen(run.summary, "begins", "waiting", 0.0, is_over=False)
        self._seen_at = run.summary.began
        """The last sign of life of the run, in seconds since 1970."""
        self.ended: float | None = None
        """The moment at which the run was seen to be over, on the steady clock."""

    def look(self, lost: Mapping[str, Unrecorded]) -> Seen:
        """Return the standing of the run."""
        if self._follower is not None:
            goes_on = is_written(self._first)  # before the news: if not, they are the last
            try:
                for item in self._follower.news():
                    if isinstance(item, State):
                        self._state = item
                    else:
                        self._state.fold(item)
                self._last = self._told(self._follower, lost, goes_on=goes_on)
            except (OSError, ValueError) as error:
                said = f"its recording cannot be read: {error}"
                self._last = Seen(self._summary, said, "stopped", 0.0, is_over=True)
            if self._last.is_over:
                self.ended = time.monotonic()
                self.close()
        if self._last.look == "lost":
            return replace(self._last, word=f"Lost for {span(time.time() - self._seen_at)}")
        return self._last

    def close(self) -> None:
        """Stop to follow the run."""
        if self._follower is not None:
            self._follower.close()
            self._follower = None

    def _told(self, follower: Follower, lost: Mapping[str, Unrecorded], *, goes_on: bool) -> Seen:
        state, beat, began = self._state, follower.recording.last_beat, self._state.began
        if began is None:
            return replace(self._last, is_over=not goes_on)
        lived = max(state.elapsed, 0.0 if beat is None else beat - began.at.wall)
        self._seen_at = began.at.wall + lived
        seen = Seen(self._summary, "goes on", "running", lived, is_over=False, state=state)
        if state.ended is not None or (state.finished is not None and not goes_on):
            words = verdict_on(state), _LOOKS[judged(state)]
            said = tuple(troubles(state))
            return replace(seen, word=words[0], look=words[1], is_over=True, why=said)
        waits = tuple(why(state, state.started + lived))
        last = f"last seen at {clock(self._seen_at)}"
        if not goes_on:
            said = f"its process was killed, {last}; it then ran:", *waits, *left_open(state)
            return replace(seen, look="lost", is_over=True, why=said)
        silence = max(0.0, time.time() - parts_of(self._first)[-1].stat().st_mtime)
        if (gap := lost.get(began.run_id)) is not None:
            return replace(
                seen, word=f"not recorded since {gap}", look="stopped", why=(f"{last}:", *waits)
            )
        if silence > STALE:
            return replace(
                seen, word=f"Stale for {span(silence)}", look="waiting", why=(f"{last}:", *waits)
            )
        if state.stop is not None:
            seen = replace(seen, word=f"stopping: {state.stop.why}", look="waiting")
        elif state.paused:
            seen = replace(seen, word="paused", look="waiting")
        ahead = min(AHEAD, silence)
        waits = tuple(why(state, state.started + lived + ahead))
        return replace(seen, seconds=lived + ahead, why=waits)


def span(seconds: float) -> str:
    """Say a duration in a word."""
    for unit, name in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * unit:
            return f"{seconds // unit:.0f} {name}"
    return f"{int(max(0.0, seconds))} s"
