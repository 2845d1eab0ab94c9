"""The feed of a browser: the events of a run in batches, later events, and a heartbeat.

The files of the run are the only store. Each browser has its own place in them, and gets events no
faster than it takes them: a browser that stops reading costs one batch of memory, and resumes by
the number of its last event.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from bt_actions.events import (
    Event,
    EventsLost,
    NodeChanged,
    NodesAdded,
    RunEnded,
)
from bt_actions.events.wire import to_plain
from bt_actions.recording.folders import Summary, is_written, read_summary
from bt_actions.recording.following import Follower
from bt_actions.recording.unrecorded import unrecorded
from bt_actions.story.actions import GoalStory
from bt_actions.story.failures import Failure
from bt_actions.story.state import State

MOST = 500
"""Events of one message."""
POLL = 0.04
"""Seconds between two looks at a run that goes on."""
BEAT = 1.0
"""Seconds between two heartbeats to a browser."""


def message(kind: str, data: object, number: str = "") -> bytes:
    """Return one server-sent event."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    head = f"id: {number}\n" if number else ""
    return f"{head}event: {kind}\ndata: {text}\n\n".encode()


async def told(
    first: Path, run_id: str, after: int, closing: Callable[[], bool]
) -> AsyncIterator[bytes]:
    """Yield the messages of a run for a browser, behind the event `after`, until the run is over.

    Raises OSError, and ValueError for a file that is none of ours.
    """
    with Follower(first) as follower:
        feed = _Feed(follower, run_id, after)
        beat, gone, last = 0.0, 0, None
        while not closing():
            now = time.monotonic()
            is_due = now - beat >= BEAT
            if is_due:
                beat = now
                gone = 0 if await asyncio.to_thread(is_written, first) else gone + 1
                await asyncio.to_thread(feed.ask)
            sent = False
            for_one = feed.batches()
            while (batch := await asyncio.to_thread(next, for_one, None)) is not None:
                yield message("events", batch, f"{run_id}:{batch['to']}")
                sent = True
                if closing():
                    return
            # A run that is beginning has its file for a moment before its lock.
            is_over = not sent and gone and (feed.ended or gone > 1)
            if is_due or is_over or follower.recording.last_beat != last:
                last = follower.recording.last_beat
                yield message("beat", feed.beat(is_written=not gone))
            if is_over:
                yield message("end", await asyncio.to_thread(feed.end))
                return
            await asyncio.sleep(POLL)


class _Feed:
    """One browser's place in a run."""

    def __init__(self, follower: Follower, run_id: str, after: int) -> None:
        self._follower, self._run_id = follower, run_id
        self._seen = 0.0
        """The moment of the latest event, in seconds since 1970."""
        self.number = after
        """The number of the browser's latest event."""
        self.ended = False
        """Whether the browser was told that the run is over."""
        self._unrecorded = ""
        """Since when a run that goes on is not recorded, and why; or ""."""

    def ask(self) -> None:
        """Ask whether the run goes on without being recorded."""
        told = (str(each) for each in unrecorded() if each.summary.run_id == self._run_id)
        self._unrecorded = next(told, "")

    def end(self) -> dict[str, Any]:
        """Return the end of the run, as far as it is known, and the last sign of life."""
        recording = self._follower.recording
        summary = read_summary(recording.first) or Summary("", "", 0.0)
        seen = max(recording.last_beat or 0.0, self._seen)
        return {
            "to": self.number,
            "ended": self.ended,
            "ago": max(0.0, time.time() - seen),
            "unrecorded": summary.unrecorded,
            "outcome": summary.status,
        }

    def beat(self, *, is_written: bool) -> dict[str, Any]:
        """Return the signs of life of the run's process."""
        recording = self._follower.recording
        return {
            "clock": recording.last_beat,
            "tick": recording.tick,
            "written": is_written,
            "damaged": recording.damaged,
            "unrecorded": self._unrecorded,
        }

    def batches(self) -> Iterator[dict[str, Any]]:
        """Yield the batches since the last look, each with the numbers that it covers."""
        events: list[dict[str, Any]] = []
        last = self.number
        for item in self._follower.news():
            self.ended = self.ended or isinstance(item, RunEnded)
            at = item.now if isinstance(item, State) else item.at
            if at is None:
                continue
            self._seen = at.wall
            if at.number <= self.number:
                continue
            events.append(known(item) if isinstance(item, State) else to_plain(item))
            if isinstance(item, EventsLost):  # its number is that of the next event
                continue
            last = at.number
            if len(events) >= MOST:
                yield self._batch(events, last)
                events = []
        if events:
            yield self._batch(events, last)

    def _batch(self, events: list[dict[str, Any]], last: int) -> dict[str, Any]:
        begins, self.number = self.number + 1, last
        return {"from": begins, "to": last, "events": events}


# A state, where the events that led to it are missing


def known(state: State) -> dict[str, Any]:
    """Return a state as one event for the page, which holds the events that lead to it."""
    assert state.now is not None
    pending = {
        number: [_failure(each) for each in story.pending]
        for number, story in state.nodes.items()
        if story.pending
    }
    return {
        "kind": "StateKnown",
        "at": list(state.now),
        "nodes": list(state.nodes),
        "events": [to_plain(event) for event in _leading_to(state)],
        "visits": [[key, each.number, each.ended] for key, each in state.nodes.items()],
        "pending": pending,
        "dealt": [_failure(each) for each in state.dealt_with],
    }


def _failure(failure: Failure) -> dict[str, Any]:
    by = failure.by.id if failure.by is not None else None
    at = list(failure.at)
    return {"node": failure.node.id, "at": at, "message": failure.message, "by": by}


def _leading_to(state: State) -> Iterator[Event]:
    assert state.began is not None
    assert state.now is not None
    nodes = tuple(story.node for story in state.nodes.values())
    began = {node.id for node in state.began.nodes}
    yield state.began
    if added := tuple(node for node in nodes if node.id not in began):
        yield NodesAdded(state.now, added)
    for story in state.nodes.values():
        if story.since is not None:
            yield NodeChanged(
                story.since,
                story.node.id,
                story.status,
                story.message,
                warning=story.warning,
                due_in=story.due_in,
            )
        if story.round is not None:
            yield story.round
    yield from state.servers.values()
    yield from state.variables.values()
    for action in state.actions:
        for goal in action.goals.values():
            yield from _goal(goal)
    for event in (state.stop, state.lasting, state.finished, state.ended):
        if event is not None:
            yield event


def _goal(goal: GoalStory) -> Iterator[Event]:
    begun = replace(goal.latest, at=goal.began, state="SENDING", outcome=None, goal=goal.goal)
    yield replace(begun, result=None)
    if goal.accepted is not None:
        yield replace(begun, at=goal.accepted, state="EXECUTING", goal=None, result=None)
    if goal.feedback is not None:
        yield goal.feedback
    yield replace(goal.latest, goal=goal.goal, result=goal.result)
    if goal.verdict is not None:
        yield goal.verdict
