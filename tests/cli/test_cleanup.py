"""`bt-actions cleanup`: what is said of goals that were left; real ones are in tests/scenarios."""

from __future__ import annotations

import errno
import sys

import pytest

from bt_actions.cli import main
from bt_actions.policy import End
from bt_actions.ros import cleanup as module
from bt_actions.ros.cleanup import LeftBehind


class Unwritable:
    """Standard output, where nothing can be written."""

    encoding = "utf-8"

    def __init__(self, error: int) -> None:
        self.error = error

    def write(self, text: str) -> int:
        raise OSError(self.error, "on purpose")

    def flush(self) -> None:
        pass

    def fileno(self) -> int:
        raise OSError


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EPIPE], ids=["full", "closed"])
@pytest.mark.parametrize("end", [End.UNKNOWN, End.CANCELED])
def test_a_goal_that_may_be_running_counts_more_than_an_output_that_is_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: int, end: End
) -> None:
    left = LeftBehind("/move", bytes(16), 1, shown=end)
    monkeypatch.setattr(module, "cleanup", lambda **_: [left])
    monkeypatch.setattr(sys, "stdout", Unwritable(error))
    lost = {errno.ENOSPC: 2, errno.EPIPE: 141}[error]
    assert main(["cleanup"]) == (3 if end is End.UNKNOWN else lost)
    said = "not all of them have ended" in capsys.readouterr().err
    assert said is (end is End.UNKNOWN)
