"""The place of a recording, for the answer to a goal whose run has just failed."""

from __future__ import annotations

import time
from pathlib import Path

from py_trees.common import Status

from bt_actions.events import Node, NodeChanged, RunBegan
from bt_actions.events.stream import BURST, Stream
from bt_actions.recording.recorder import Recorder, Wish


def test_a_run_that_begins_with_a_burst_has_its_place_before_the_burst_is_over(
    tmp_path: Path,
) -> None:
    stream = Stream(lambda: (time.monotonic(), time.time(), 0.0))
    recorder = Recorder(Wish(where=tmp_path), print)
    run = recorder.record(stream, lambda: None)
    stream.add(RunBegan, "0" * 32, "work", (Node(1, None, "a", "b"),), {}, {}, {})
    for _ in range(3 * BURST):
        stream.add(NodeChanged, 1, Status.SUCCESS, "done")
    assert Path(run.place().removeprefix(":")).is_file()
    recorder.close()
