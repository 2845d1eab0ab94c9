"""The log of goals never raises: what it would take along is the life of a goal."""

import threading
from typing import Any

import pytest

from bt_actions.ros.log import Log


class Written:
    """In place of rclpy's logger."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __getattr__(self, level: str) -> Any:
        return lambda text: self.lines.append(f"{level}: {text}")


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
