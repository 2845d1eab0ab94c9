"""What it costs a run that its events are recorded, or shown in a terminal."""

from __future__ import annotations

import io
import os
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from test_msgs.action import Fibonacci

from benchmarks import processes
from benchmarks.chain import ACTION, GOALS, STOCK
from benchmarks.harness import MANY, Family, Figures, Row
from benchmarks.readers import READERS, readers
from benchmarks.wire import Wire
from bt_actions import ActionBehaviour, TreeRunner
from bt_actions.events import Moment, Node, NodeChanged, RunBegan
from bt_actions.events.stream import Stream
from bt_actions.recording.finishing import finish_beside
from bt_actions.recording.recorder import Recorder, Wish
from bt_actions.recording.writing import RunWriter

LARGE = 100_000_000
WATCHED = f"on {READERS} pages, and one that stopped reading"
RATE, TICKS, CHANGES = 100.0, 500, 10
"""Ticks a second, ticks in all, and events in each."""


def _recorded(stream: Stream) -> Callable[[], None]:
    folder = tempfile.TemporaryDirectory()
    recorder = Recorder(Wish(where=Path(folder.name)), print)
    recorder.record(stream, lambda: None)

    def close() -> None:
        recorder.close()
        folder.cleanup()

    return close


def _watched(stream: Stream) -> Callable[[], None]:
    """Record, and have the page tell it to readers of which one stops to read."""
    folder = tempfile.TemporaryDirectory()
    os.environ["XDG_STATE_HOME"] = folder.name
    serving = readers(Path(folder.name))
    serving.__enter__()
    recorder = Recorder(Wish(), print)
    recorder.record(stream, lambda: None)

    def close() -> None:
        serving.__exit__(None, None, None)
        recorder.close()
        folder.cleanup()

    return close


def _shown(stream: Stream) -> Callable[[], None]:
    """Read as `bt-actions run` does, on a thread of its own, and write the lines to nowhere."""
    from bt_actions.cli.driving.drive import GATHER
    from bt_actions.cli.driving.feed import Feed
    from bt_actions.cli.views.lines import LineView
    from bt_actions.story.state import State
    from bt_actions.utilities.batches import BATCH, LONGEST

    state = State()
    feed = Feed(state, LineView(state, io.StringIO(), verbose=False))
    news, ends = threading.Event(), threading.Event()
    reader = stream.reader(news.set)

    def show() -> None:
        while not ends.is_set():
            news.wait(0.1)
            news.clear()
            time.sleep(GATHER)
            until = time.monotonic() + LONGEST
            while reader.is_burst and time.monotonic() < until and not ends.is_set():
                ends.wait(BATCH)
            for event in reader.take():
                feed.event(event)

    thread = threading.Thread(target=show)
    thread.start()

    def close() -> None:
        ends.set()
        thread.join()

    return close


def _finishes(stream: Stream) -> Callable[[], None]:
    """Have the files of another run, of 100 MB, finished meanwhile."""
    folder = tempfile.TemporaryDirectory()
    first = Path(folder.name) / "run.mcap"
    began = RunBegan(
        Moment(1, 1.0, 1.0, 1.0), "0" * 32, "long", (Node(1, None, "a", "b"),), {}, {}, {}
    )
    writer = RunWriter(first, began)
    writer.add(began)
    writer.flush()
    head = first.stat().st_size
    for number in range(2000):
        at = Moment(2 + number, 1.0 + number, 1.0 + number, 1.0)
        writer.add(NodeChanged(at, 1, Status.SUCCESS, f"said {number}"))
    writer.close()
    data = first.read_bytes()
    with first.open("ab") as file:
        while file.tell() < LARGE:
            file.write(data[head:])
    process = finish_beside(first, may_wait=False)

    def close() -> None:
        assert process is not None
        process.kill()
        process.wait()
        folder.cleanup()

    return close


_READERS: dict[str, Callable[[Stream], Callable[[], None]]] = {
    "alone": lambda stream: lambda: None,
    "recorded": _recorded,
    "shown": _shown,
    "while 100 MB are finished": _finishes,
    WATCHED: _watched,
}


def chain(name: str) -> Figures:
    """A chain of goals, with nobody or somebody reading its events."""
    wire = Wire()
    root = py_trees.composites.Sequence("goals", memory=True)
    root.add_children(
        [ActionBehaviour(f"goal {n}", Fibonacci, ACTION, {"order": n}) for n in range(GOALS)]
    )
    with TreeRunner(root) as runner:
        close = _READERS[name](runner.stream)
        assert runner.run(timeout=120.0) is Status.SUCCESS, root.tip().feedback_message
        close()
    return wire.figures(GOALS)


class _Changing(Behaviour):
    """Succeeds in each of its ticks."""

    def update(self) -> Status:
        return Status.SUCCESS


class _Paced(Behaviour):
    """Has the tree ticked at a rate, and ends the run."""

    def __init__(self) -> None:
        super().__init__("paced")
        self.left = TICKS

    def update(self) -> Status:
        self.left -= 1
        return Status.SUCCESS if self.left <= 0 else Status.RUNNING

    def due_in(self) -> float:
        return 1.0 / RATE


def tick(name: str) -> Figures:
    """How long a tick takes in which ten nodes end, a hundred times a second."""
    from bt_actions.running import loop

    took: list[float] = []
    once = loop.tick_once

    def timed(*args: Any) -> None:
        began = time.perf_counter()
        once(*args)
        took.append(1e3 * (time.perf_counter() - began))

    loop.tick_once = timed  # type: ignore[assignment]
    root = py_trees.composites.Parallel(
        "all", ParallelPolicy.SuccessOnSelected([paced := _Paced()], synchronise=False)
    )
    root.add_children([*(_Changing(f"leaf {n}") for n in range(CHANGES)), paced])
    with TreeRunner(root, heartbeat=1.0 / RATE) as runner:
        close = _READERS[name](runner.stream)
        assert runner.run(timeout=120.0) is Status.SUCCESS
        close()
    took.sort()
    return {"p50": took[len(took) // 2], "p99": took[int(len(took) * 0.99)]}


def _served(name: str) -> Figures:
    expected, by = {ACTION: range(GOALS)}, ("recording", f"chain {name}")
    if name == "hand":
        by = ("chain", name)
    return processes.accounted(*by, expected, server=(ACTION,))


CHAINS = Family(
    [
        Row(
            f"15, shown, {each.number}",
            f"{each.work}, shown",
            each.yardstick,
            ("shown", each.ours[1]),
            each.theirs,
            each.at_most,
            slack=2.0,
        )
        for each in STOCK.rows
    ]
    + [
        Row(
            f"15, {name}",
            f"an action in a chain of 150, {name}",
            "with nobody reading",
            (name, "an action"),
            ("alone", "an action"),
            at_most,
            slack=1.4,
        )
        for name, at_most in (("recorded", 1.03), ("shown", 1.1))
    ],
    {name: lambda name=name: _served(name) for name in ("hand", "alone", "recorded", "shown")},
    MANY,
)
TICKED = Family(
    [
        Row(
            f"16, {name}",
            f"the p99 of a tick with 10 events, 100 a second, {name}",
            "with nobody reading",
            (name, "p99"),
            ("alone", "p99"),
            0.2,
            is_difference=True,
            slack=3.0,
        )
        for name in _READERS
        if name not in ("alone", WATCHED)
    ]
    + [
        Row(
            "20",
            f"the p99 of a tick with 10 events, 100 a second, {WATCHED}",
            "recorded",
            (WATCHED, "p99"),
            ("recorded", "p99"),
            0.3,
            is_difference=True,
            slack=3.0,
        )
    ],
    {name: lambda name=name: processes.side("recording", f"tick {name}") for name in _READERS},
    MANY,
)

if __name__ == "__main__":
    processes.answer(
        {f"chain {name}": lambda name=name: chain(name) for name in _READERS}
        | {f"tick {name}": lambda name=name: tick(name) for name in _READERS}
    )
