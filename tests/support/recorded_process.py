"""A process that records a run without an end: ``FOLDER EVENTS_A_SECOND``. Without ROS.

Each event is told on standard output as well, with the time at which it happened.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from bt_actions.events import RunBegan, VariableWritten
from bt_actions.events.stream import Stream
from bt_actions.recording.recorder import Recorder, Wish
from tests.support.every_kind import NODES, RUN_ID


def clock() -> tuple[float, float, float]:
    return time.monotonic(), time.time(), 0.0


def main(folder: Path, rate: float) -> None:
    stream = Stream(clock)
    Recorder(Wish(where=folder), print).record(stream, lambda: None)
    stream.add(RunBegan, RUN_ID, "endless", NODES, {}, {}, {})
    number = 0
    while True:
        number += 1
        stream.add(VariableWritten, "x", number, None)
        print(number, time.monotonic(), flush=True)
        time.sleep(1.0 / rate)


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]))
