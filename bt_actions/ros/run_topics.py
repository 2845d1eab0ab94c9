"""The events and the states of a node's runs, on its topics ``~/events`` and ``~/tree``.

A thread of its own publishes: no tick waits for a subscriber. A late subscriber, or one that has
lost events, takes the whole state from ``~/tree`` and goes on from its number: each new
subscription gets a state that the next event follows. Without subscriptions nothing is encoded.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace

from bt_actions_interfaces.msg import RunEvent, RunState, RunStates
from rclpy.node import Node
from rclpy.time import Time

from bt_actions.events import (
    Event,
    EventsLost,
    Moment,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    RunBegan,
    RunEnded,
    TreeFinished,
    to_line,
)
from bt_actions.events.bare import bare
from bt_actions.events.stream import Stream
from bt_actions.ros.node_participant import NodeParticipant
from bt_actions.story.keeping import to_json
from bt_actions.story.state import State
from bt_actions.utilities.batches import Batches
from bt_actions.utilities.plain_text import clean

STATE_WITHIN = 10.0
"""Seconds after any event until a state with the event is published."""
_SOONER: dict[type[Event], float] = {
    RunBegan: 0.0,
    TreeFinished: 0.0,
    RunEnded: 0.0,
    EventsLost: 0.0,
    NodesAdded: 1.0,
    NodesRemoved: 1.0,
}
"""The same seconds after some kinds of events."""
PATIENCE = 2.0
"""Seconds in which the last events are published at the close of the topics."""


class RunTopics:
    """The two topics of a node, for all of its runs.

    With `values`, subscribers also get goals, results, feedback, variables, inputs and outputs;
    secrets and the text of tree files never.
    """

    def __init__(self, node: Node, *, values: bool = False) -> None:
        self._context = node.context
        participant = NodeParticipant.of(node)
        self._events = participant.publisher(RunEvent, "~/events", "events")
        self._states = participant.publisher(RunStates, "~/tree", "latched")
        self._values = values
        self._runs: list[_Run] = []
        self._listeners = 0
        self._due = math.inf
        """The moment of the next state, on the steady clock."""
        self._batches = Batches("bt_actions-topics", self._step)
        self._batches.start()

    def follow(self, stream: Stream) -> None:
        """Publish the events of a run from now on, until its RunEnded."""
        self._runs.append(_Run(stream, self._batches.poke, values=self._values))

    def close(self) -> None:
        """Publish the last events, and close, while the node is still there."""
        self._batches.close(PATIENCE)
        self._events.close()
        self._states.close()

    # On the thread of the topics

    def _step(self, last: bool) -> None:
        try:
            self._publish(time.monotonic())
        except RuntimeError:  # RCLError, which is public nowhere
            if self._context.ok():
                raise

    def _publish(self, now: float) -> None:
        heard, watched = self._events.listeners, self._states.listeners
        if heard + watched > self._listeners:
            self._due = now
        self._listeners = heard + watched
        for run in list(self._runs):
            for event in run.take():
                self._due = min(self._due, now + _SOONER.get(type(event), STATE_WITHIN))
                told = run.fold(event)
                if heard and not isinstance(event, EventsLost):  # the gap in the numbers tells it
                    self._events.publish(run.message(event, told))
                if isinstance(event, RunEnded):
                    self._over(run)
                time.sleep(0)  # a thread that waits for Python's lock is next
        if watched and now >= self._due:
            self._due = math.inf
            states = [run.standing() for run in self._runs if run.state.began is not None]
            self._states.publish(RunStates(runs=states))

    def _over(self, run: _Run) -> None:
        """Keep a run as the latest that has ended, and none that ended before."""
        for other in list(self._runs):
            if other.over:
                self._runs.remove(other)
        run.leave()


class _Run:
    """One run of the node."""

    def __init__(self, stream: Stream, poke: Callable[[], None], *, values: bool) -> None:
        self._stream, self._values = stream, values
        self._reader = stream.reader(poke)
        self._waiting: deque[Event] = deque()
        """Events from before the run's begin, and so before its id, that are not published yet."""
        self._id: list[int] = []
        self.state = State()
        self.over = False
        self._latest = Moment(0, 0.0, 0.0, 0.0)
        self._standing = RunState()
        """The last state that a subscriber wanted."""

    def take(self) -> Iterator[Event]:
        """Yield the new events, once the run's id is known."""
        self._waiting += self._reader.take()
        if not self._id:
            began = next((each for each in self._waiting if isinstance(each, RunBegan)), None)
            if began is None:
                return
            self._id = _bytes(began)
        while self._waiting:
            yield self._waiting.popleft()

    def fold(self, event: Event) -> Event | None:
        """Take in an event; return what subscribers may know of it."""
        told: Event | None = event
        if isinstance(event, RunBegan):
            self._id, told = _bytes(event), replace(event, sources={})
        if not self._values and told is not None:
            told = bare(told)
        self._latest = event.at
        if told is not None:
            self.state.fold(told)
        return told

    def message(self, event: Event, told: Event | None) -> RunEvent:
        """Return an event as a message: of an event that nobody may know, its kind."""
        status: int = RunEvent.NONE
        if isinstance(event, NodeChanged):
            status = getattr(RunEvent, event.status.name)
        return RunEvent(
            run_id=self._id,
            number=event.at.number,
            stamp=_stamp(event.at),
            node=getattr(event, "node", None) or 0,
            status=status,
            kind=type(event).__name__,
            data="" if told is None else to_line(told),
        )

    def standing(self) -> RunState:
        """Return the state of the run as a message."""
        if self._standing.number != self._latest.number:
            self._standing = RunState(
                run_id=self._id,
                number=self._latest.number,
                stamp=_stamp(self._latest),
                tree=clean(self.state.tree),
                data=to_json(self.state),
            )
        return self._standing

    def leave(self) -> None:
        """Take note that the run is over."""
        self.over = True
        self._stream.leave(self._reader)


def _bytes(began: RunBegan) -> list[int]:
    return list(bytes.fromhex(began.run_id))


def _stamp(at: Moment) -> object:
    return Time(nanoseconds=round(at.ros * 1e9)).to_msg()
