"""The log of goals never raises: what it would take along is the life of a goal."""

import threading
from typing import Any

import pytest

from bt_actions.ros.log import LONGEST, Log


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
    assert len(line.removeprefix("error: ").encode()) == LONGEST


def test_a_logger_of_a_node_that_is_gone_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone:
        def __getattr__(self, level: str) -> Any:
            raise RuntimeError("its node was destroyed")

    log, written = Log("test"), Written()
    monkeypatch.setattr(log, "_logger", written)
    log.by(Gone(), "info", "not written")
    log.info("and on")
    log.flush(10.0)
    assert written.lines == ["info: and on"]


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
    assert not log._lines.unfinished_tasks
