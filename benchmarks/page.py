"""What the page costs a browser: 5,000 nodes of which 20 change a second, and leaps in a long run.

The browser is Chromium, headless, as in the tests.
"""

from __future__ import annotations

import gzip
import itertools
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from py_trees.common import Status

from benchmarks.harness import Family, Figures, Row
from bt_actions.events import (
    Event,
    FeedbackCame,
    GoalChanged,
    Moment,
    Node,
    NodeChanged,
    RunBegan,
    ServerSeen,
)
from bt_actions.events.stream import Stream
from bt_actions.goals.policy import End, Outcome
from bt_actions.page.report import page
from bt_actions.page.static_files import static_files
from bt_actions.recording.folders import FIRST
from bt_actions.recording.recorder import Recorder, Wish
from bt_actions.recording.report import reports
from bt_actions.recording.writing import RunWriter
from tests.support.browser import browser

ROBOTS, TASKS, STEPS = 50, 9, 10
RATE = 20.0
"""Changes of nodes a second."""
SECONDS = 8.0
LONG = 100_000
"""Events of the run that is leaped in."""
LEAPS = 24
RUN_ID = "5" * 32
PAINTED = """
window.painted = { took: [], late: [] };
const ask = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (frame) => ask((now) => {
  const { s, run } = window.page ?? {}, number = s?.i ?? 0, began = performance.now();
  window.paints = false;
  frame(now);
  const took = performance.now() - began;
  if (!window.paints) return;
  painted.took.push(took);
  const event = run?.events[(page.s?.i ?? 0) - 1];
  if (event && page.s.i > number) {
    const late = () => painted.late.push(Date.now() - event.at[2] * 1000);
    setTimeout(late);    // which comes behind the pixels
  }
});
"""
"""Notes how long each frame that paints computes, and how late the newest event of it is then."""
COUNT = """
const { run } = page, at = run.at.bind(run);
run.at = (t) => { window.paints = true; return at(t); };
"""
LEAP = """
const began = performance.now();
page.seek(arguments[0]);
return new Promise((done) => {
  const shown = () => setTimeout(() => done(performance.now() - began));
  const look = () => (page.s.t === page.t ? shown() : requestAnimationFrame(look));
  requestAnimationFrame(look);
});
"""


def nodes() -> list[Node]:
    """A fleet: each robot does its tasks, each of some steps, which are actions."""
    found = [Node(1, None, "Fleet", "parallel, all")]
    number = itertools.count(2)
    for robot in range(ROBOTS):
        found.append(Node(next(number), 1, f"Robot {robot:02}", "reactive sequence"))
        above = found[-1].id
        for task in range(TASKS):
            found.append(Node(next(number), above, f"Task {task}", "sequence"))
            inner = found[-1].id
            for step in range(STEPS):
                found.append(
                    Node(
                        next(number),
                        inner,
                        f"Step {task}.{step}",
                        "action",
                        f"fleet.yaml:{len(found)}:3",
                        f"/robot_{robot:02}/move",
                        "Move",
                        {"attempts": 3, "timeouts": {"result": 60.0, "feedback": 5.0}},
                    )
                )
    return found


def told(add: Callable[..., None]) -> Iterator[None]:
    """Tell by `add` of a run that begins, and for ever of one change of a node after the other."""
    tree = nodes()
    above = {node.id: node.parent for node in tree}
    leaves = [node for node in tree if node.server]
    add(RunBegan, RUN_ID, "fleet", tuple(tree), {}, {}, {})
    for server in dict.fromkeys(leaf.server for leaf in leaves):
        add(ServerSeen, server, True)
    add(NodeChanged, 1, Status.RUNNING, "")
    going = deque[tuple[Node, str]]()
    for count in itertools.count():
        yield
        if len(going) < ROBOTS:
            leaf, goal = leaves[count * 37 % len(leaves)], f"{count:032x}"
            going.append((leaf, goal))
            if count % 4 == 0:
                add(NodeChanged, above[leaf.id], Status.RUNNING, "")
                yield
            add(NodeChanged, leaf.id, Status.RUNNING, "")
            of = leaf.id, goal, 1
            add(GoalChanged, *of, "SENDING", None, None, "", leaf.server, {"distance": 1.0})
            add(GoalChanged, *of, "EXECUTING", None, None, "", leaf.server)
            add(FeedbackCame, leaf.id, goal, {"current_pose": count / 10.0})
            yield
        leaf, goal = going.popleft()
        over = "DONE", Outcome.SUCCEEDED, End.SUCCEEDED, "", leaf.server, None, {"pose": 1.0}
        add(GoalChanged, leaf.id, goal, 1, *over)
        add(NodeChanged, leaf.id, Status.SUCCESS, "")


def live() -> Figures:
    """A run that goes on, through its recorder, `bt-actions view`, and a browser."""
    stream = Stream(lambda: (time.monotonic(), time.time(), time.time()))
    with tempfile.TemporaryDirectory() as folder, browser() as window:
        first = Path(folder) / FIRST
        recorder = Recorder(Wish(first=first), print)
        recorder.record(stream, lambda: None)
        changes = told(stream.add)
        next(changes)
        while not first.exists():
            time.sleep(0.01)
        with _view(first) as address:
            window.page.add_init_script(PAINTED)
            window.open(address, 1440, 900)
            assert window.wait_for("window.page?.shown")
            window.run(f"{COUNT} page.go_tab('log'); page.go_tab('details')")
            for pane in ("", "page.select(page.run.leaves(page.s)[0], { reveal: true })"):
                window.run(pane)
                for _ in range(round(SECONDS * RATE / 2)):
                    time.sleep(1 / RATE)
                    next(changes)
            took, late = window.run("return [painted.took, painted.late]")
        recorder.close()
    return {
        "median": median(took),
        "p95": quantiles(took, n=20)[-1],
        "pixel": median(late),
    }


@contextmanager
def _view(first: Path) -> Iterator[str]:
    command = [sys.executable, "-m", "bt_actions.cli", "view", str(first)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().strip()
        finally:
            process.send_signal(signal.SIGINT)


def leap() -> Figures:
    """From a press to what is seen, anywhere in a run of LONG events."""
    with tempfile.TemporaryDirectory() as folder, browser() as window:
        first = Path(folder) / FIRST
        number, writer = 0, list[RunWriter]()

        def add(kind: type[Event], *of: Any) -> None:
            nonlocal number
            number += 1
            event = kind(Moment(number, number / 100.0, 1e9 + number / 100.0, 0.0), *of)
            if isinstance(event, RunBegan):
                writer.append(RunWriter(first, event))
            writer[0].add(event)

        for _ in told(add):
            if number >= LONG:
                break
        writer[0].close()
        file = Path(folder) / "run.html"
        file.write_text(page(reports(first)), "utf-8")
        window.open(file, 1440, 900)
        assert window.wait_for("window.page?.shown")
        head = window.run("return page.head")
        places = [(count * 0.618 % 1.0) * head for count in range(LEAPS)]
        return {"ms": median(window.run(LEAP, place) for place in places)}


def size() -> Figures:
    """What a browser loads of the page itself."""
    return {"kB": sum(len(gzip.compress(text.encode())) for text in static_files().values()) / 1e3}


def _row(number: str, work: str, ours: str, at_most: float, unit: str = "ms") -> Row:
    side, _, figure = ours.partition(".")
    return Row(number, work, "", (side, figure), None, at_most, unit, slack=3.0)


FAMILY = Family(
    [
        _row("17, median", "a frame of the page: 5,000 nodes, 20 changes/s", "live.median", 3.0),
        _row("17, p95", "the slowest of 20 such frames", "live.p95", 8.0),
        _row("17, pixel", "from an event in the run to its pixels", "live.pixel", 100.0),
        _row("18", f"a leap in {LONG:,} events", "leap.ms", 100.0),
        _row("19", "the page without data, compressed", "size.kB", 100.0, "kB"),
    ],
    {"live": live, "leap": leap, "size": size},
)
