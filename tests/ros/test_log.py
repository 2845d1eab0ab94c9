"""The log of goals never raises: what it would take along is the life of a goal."""

from __future__ import annotations

import itertools
import logging
import os
import pty
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest
import rclpy.logging

from bt_actions.ros import log as module
from bt_actions.ros.log import LINE, LONGEST, MOST, Log
from bt_actions.traffic.backend import LEVELS
from tests.support.waiting import until

_numbers = itertools.count()


class Written(logging.Handler):
    """A handler of the user's, which also stands in for a logger of rclpy's."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.reads = threading.Event()
        """From then on standard error is read."""
        self.reads.set()

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(f"{record.levelname.lower()}: {record.getMessage()}")

    def log(self, text: str, level: int) -> None:
        self.lines.append(f"{logging.getLevelName(level).lower()}: {text}")


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> Iterator[Written]:
    each = Written()
    monkeypatch.setattr(module, "_has_room", lambda: each.reads.wait(60.0))
    monkeypatch.setattr(module, "get_logger", lambda _name: each)
    yield each
    each.reads.set()


@pytest.fixture
def log(written: Written) -> Log:
    """One that writes to `written` only."""
    name = f"test{next(_numbers)}"
    made = Log(name)
    made._logger.handlers[:] = [written]
    return made


def test_a_line_of_ours_is_one_line_that_can_be_read(log: Log, written: Written) -> None:
    log.error("the motor\nis hot; " * 300 + "do this")
    log.flush()
    (line,) = written.lines
    assert len(line.removeprefix("error: ")) == LINE
    assert line.endswith("the motor is hot; do this")


def test_a_tree_s_line_fits_into_a_pipe_that_has_room(log: Log, written: Written) -> None:
    """Standard error is asked for room before each, and never takes half a line."""
    log.by("tree", "error", "\N{CYRILLIC SMALL LETTER ZHE}" * LONGEST)
    log.flush()
    (line,) = written.lines
    assert LONGEST - 1 <= len(line.removeprefix("error: ").encode()) <= LONGEST


def test_a_tree_that_logs_in_a_loop_loses_nothing_that_fits(log: Log, written: Written) -> None:
    for number in range(MOST):
        log.by("tree", "info", str(number))
    until(lambda: len(written.lines) == MOST)
    assert written.lines == [f"info: {number}" for number in range(MOST)]


def test_where_nobody_reads_newer_lines_are_counted(log: Log, written: Written) -> None:
    written.reads.clear()
    for number in range(2 * MOST):
        log.info(str(number))
    log.flush()
    log.flush()  # it was waited for in vain already
    written.reads.set()
    until(lambda: written.lines and "were not logged" in written.lines[-1])
    *whole, told = written.lines
    assert whole == [f"info: {number}" for number in range(len(whole))]
    assert told == f"warning: {2 * MOST - len(whole)} lines were not logged"
    log.info("and on")
    log.flush()
    assert written.lines[-1] == "info: and on"


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
log._lines.join()
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


@pytest.mark.parametrize("level", LEVELS)
def test_a_line_looks_as_one_of_rclpys(level: str, capfd: pytest.CaptureFixture[str]) -> None:
    rclpy.logging.get_logger("test").log("of a goal", LEVELS[level])
    by_rclpy = capfd.readouterr().err
    Log("test")._logger.log(LEVELS[level], "of a goal")
    by_hand = capfd.readouterr().err
    logging.getLogger("test").handlers.clear()
    numbers = re.compile(r"\d+\.\d{9}")
    assert numbers.sub("", by_hand) == numbers.sub("", by_rclpy)
    assert bool(by_hand) is (level != "debug")


def test_the_child_of_a_fork_leaves_to_its_parent_what_waits(log: Log, written: Written) -> None:
    written.reads.clear()
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
            written.reads.set()
            log.info("of the child")
            log.flush()
            os._exit(0 if written.lines == ["info: of the child"] else 1)
        finally:
            os._exit(2)
    assert os.waitpid(child, 0)[1] == 0
    forked.set()
    holder.join()
    written.reads.set()
    until(lambda: written.lines == ["info: in its hands", "error: of the parent's goal"])


def test_no_line_holds_what_a_terminal_obeys(log: Log, written: Written) -> None:
    log.by("tree", "info", "a\x1b]0;title\x07b\r\x9bc\u202ed\ud800\n\te")
    log.flush()
    assert written.lines == ["info: a ]0;title b  c d \n  \te"]
