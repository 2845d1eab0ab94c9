"""The log of goals never raises: what it would take along is the life of a goal."""

import itertools
import threading
import time
from typing import Any

import pytest

from bt_actions.ros.log import LONGEST, MOST, Log
from tests.support.waiting import until


class Written:
    """In place of rclpy's logger."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __getattr__(self, level: str) -> Any:
        return lambda text: self.lines.append(f"{level}: {text}")


def test_a_line_fits_into_a_pipe_that_has_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Standard error is asked for room before each, and never takes half a line."""
    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    log.error("\N{CYRILLIC SMALL LETTER ZHE}" * LONGEST)
    log.flush(10.0)
    (line,) = written.lines
    assert LONGEST - 1 <= len(line.removeprefix("error: ").encode()) <= LONGEST
    assert line.endswith("...")


def test_a_tree_that_logs_in_a_loop_loses_nothing_while_somebody_reads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    for number in range(3 * MOST):
        log.by(written, "info", str(number))
    log.error("of a goal")
    log.flush(10.0)
    assert written.lines == [*(f"info: {number}" for number in range(3 * MOST)), "error: of a goal"]


def test_where_nobody_reads_a_tree_leaves_room_for_goals_and_what_was_dropped_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, written, reads = Log("test"), Written(), threading.Event()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(log, "_room", lambda patience: patience != 0 and reads.wait(60.0))
    for number in range(2 * MOST):
        log.by(written, "info", str(number))
    log.error("of a goal")
    log.flush(0.1)
    log.flush(60.0)  # it was waited for in vain already
    reads.set()
    until(lambda: written.lines and written.lines[-1] == "error: of a goal")
    told = next(line for line in written.lines if "were not logged" in line)
    number = int(told.removeprefix("warning: ").split()[0])
    assert len(written.lines) - 2 + number == 2 * MOST


def test_a_reader_that_falters_is_waited_for_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tree that logs has given up by then; what is said of goals at the end has not."""
    log, written, reads = Log("test"), Written(), threading.Event()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(log, "_room", lambda patience: patience != 0 and reads.wait(60.0))
    for number in range(MOST):
        log.by(written, "info", str(number))
    assert log._slow_at == 0
    log.error("of a goal")
    flush = threading.Thread(target=log.flush, args=(60.0,))
    flush.start()
    reads.set()
    flush.join()
    assert "error: of a goal" in written.lines


def test_where_its_thread_does_not_come_to_it_flush_writes_what_there_is_room_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, written, goes_on = Log("test"), Written(), threading.Event()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(log, "_room", lambda patience: patience == 0 or goes_on.wait(60.0))
    log.info("in its hands")
    until(lambda: log._lines.empty())
    log.error("a goal is not accounted for")
    log.flush(0.01)
    assert written.lines == ["error: a goal is not accounted for"]
    goes_on.set()
    until(lambda: written.lines[1:] == ["info: in its hands"])
    log.flush(10.0)
    assert log._written == log._taken == 2


def test_the_time_that_a_process_was_stopped_for_is_not_the_logs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A machine that stood still for longer than `flush` waits: nothing has been in vain."""
    log, written, passes = Log("test"), Written(), threading.Event()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(log, "_room", lambda patience: patience != 0 and passes.wait(60.0))
    log.error("a goal is not accounted for")
    monkeypatch.setattr(time, "monotonic", itertools.count(0.0, 100.0).__next__)
    nap = time.sleep

    def goes_on(seconds: float) -> None:
        passes.set()
        nap(seconds)

    monkeypatch.setattr(time, "sleep", goes_on)
    log.flush(10.0)
    assert written.lines == ["error: a goal is not accounted for"]


def test_what_was_dropped_last_is_told_too(monkeypatch: pytest.MonkeyPatch) -> None:
    log, written, reads = Log("test"), Written(), threading.Event()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(log, "_room", lambda patience: patience != 0 and reads.wait(60.0))
    for number in range(2 * MOST):
        log.info(str(number))
    reads.set()
    until(lambda: written.lines and "were not logged" in written.lines[-1])


def test_a_logger_of_a_node_that_is_gone_loses_nothing(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    class Gone:
        def __getattr__(self, level: str) -> Any:
            raise RuntimeError("its node was destroyed")

    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    log.by(Gone(), "warn", "of a node")
    log.info("and on")
    log.flush(10.0)
    assert written.lines == ["info: and on"]
    assert capfd.readouterr().err == "[WARN] of a node\n"


def test_where_no_thread_can_be_started_the_line_is_written_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(threading.Thread, "start", refuse)
    log.error("a goal is not accounted for")
    log.info("and on")
    monkeypatch.undo()
    assert written.lines == ["error: a goal is not accounted for", "info: and on"]
    log.flush(0.0)
    assert log._written == log._taken
