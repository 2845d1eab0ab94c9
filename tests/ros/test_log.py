"""The log of goals never raises: what it would take along is the life of a goal."""

import itertools
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from typing import Any

import pytest
import rclpy.logging

from bt_actions.ros.log import LONGEST, MOST, WRITE, Log
from tests.support.waiting import until


class Written:
    """In place of rclpy's logger."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __getattr__(self, level: str) -> Any:
        return lambda text: self.lines.append(f"{level}: {text}")


def stuck_log(monkeypatch: pytest.MonkeyPatch) -> tuple[Log, Written, threading.Event]:
    """A log, what it has written, and the event from which on its reader reads."""
    log, written, reads = Log("test"), Written(), threading.Event()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(log, "_room", lambda patience: reads.wait(60.0 if patience is None else 0))
    return log, written, reads


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
    log, written, reads = stuck_log(monkeypatch)
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
    log, written, reads = stuck_log(monkeypatch)
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
    log, written, passes = stuck_log(monkeypatch)
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
    log, written, reads = stuck_log(monkeypatch)
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
    assert re.fullmatch(r"\[WARN\] \[\d+\.\d{9}\] \[test\]: of a node\n", capfd.readouterr().err)


@pytest.mark.parametrize("why", ["there are too many", "the interpreter is being taken down"])
def test_where_no_thread_can_be_started_the_line_is_written_at_once(
    monkeypatch: pytest.MonkeyPatch, why: str
) -> None:
    def refuse(self: threading.Thread) -> None:
        assert why == "there are too many", "it would wait for ever"
        raise RuntimeError("can't start new thread")

    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    monkeypatch.setattr(threading.Thread, "start", refuse)
    monkeypatch.setattr(sys, "is_finalizing", lambda: why != "there are too many")
    log.error("a goal is not accounted for")
    log.info("and on")
    monkeypatch.undo()
    assert written.lines == ["error: a goal is not accounted for", "info: and on"]
    log.flush(0.0)
    assert log._written == log._taken


ONE_THAT_GOES_ON = """
import os, threading, time
from bt_actions.ros.log import log
logged = threading.Thread(target=lambda: [log.error("x" * 500 + f"-{n}") for n in range(500)])
logged.start()
logged.join()
for _ in range(200):
    time.sleep(0.005)
print("went on", flush=True)
input()
log.flush(60.0)
os._exit(0)
"""


def test_a_terminal_that_nobody_reads_holds_up_nothing() -> None:
    """It says that it has room for a byte, and a line does not fit: rclpy would wait for it."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", ONE_THAT_GOES_ON],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=theirs, text=True,
    )  # fmt: skip
    os.close(theirs)
    said = b""
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == "went on\n"
        process.stdin.write("\n")
        process.stdin.flush()
        while b"-499\x1b[0m\r\n" not in said:
            said += os.read(ours, 65536)
        assert process.wait(20.0) == 0
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    assert [n for n in range(500) if f"x-{n}\x1b[0m\r\n".encode() not in said] == []
    assert said.startswith(b"\x1b[31m[ERROR] [")


@pytest.mark.parametrize("level", WRITE)
def test_a_line_by_hand_looks_as_one_of_rclpys(
    level: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    WRITE[level](rclpy.logging.get_logger("test"), "of a goal")
    by_rclpy = capfd.readouterr().err
    monkeypatch.setenv("RCUTILS_LOGGING_USE_STDOUT", "1")  # which rclpy has looked for by now
    log = Log("test")
    log._put(level, "of a goal")
    log.flush(10.0)
    by_hand = capfd.readouterr().err
    numbers = re.compile(r"\d+\.\d{9}")
    assert numbers.sub("", by_hand) == numbers.sub("", by_rclpy)
    assert bool(by_hand) is (level != "debug")


def test_the_child_of_a_fork_leaves_to_its_parent_what_waits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, written, reads = stuck_log(monkeypatch)
    log.info("in its hands")
    log.error("of the parent's goal")
    held, forked = threading.Event(), threading.Event()

    def hold() -> None:
        with log._guard:
            held.set()
            forked.wait(60.0)

    holder = threading.Thread(target=hold)  # which is not there in the child
    holder.start()
    held.wait(60.0)
    child = os.fork()
    if not child:
        try:
            signal.alarm(20)
            reads.set()
            log.info("of the child")
            log.flush(10.0)
            os._exit(0 if written.lines == ["info: of the child"] else 1)
        finally:
            os._exit(2)
    assert os.waitpid(child, 0)[1] == 0
    forked.set()
    holder.join()
    reads.set()
    until(lambda: written.lines == ["info: in its hands", "error: of the parent's goal"])


def test_no_line_holds_what_a_terminal_obeys(monkeypatch: pytest.MonkeyPatch) -> None:
    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    log.info("a\x1b]0;title\x07b\r\x9bc\u202ed\ud800\n\te")
    log.flush(10.0)
    assert written.lines == ["info: a ]0;title b  c d \n  \te"]
