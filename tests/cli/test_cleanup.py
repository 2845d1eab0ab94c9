"""`bt-actions cleanup`: what is said of goals that were left; real ones are in tests/scenarios."""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable
from typing import Any

import pytest

from bt_actions.cli import main
from bt_actions.cli.cleanup import sweep
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


def test_where_no_server_is_in_sight_nobody_says_that_nothing_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """They may be stopped, or start later; or this is the wrong domain."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    in_sight: list[str] = []

    def cleanup(*, sighted: Callable[[str], None], **_: Any) -> list[LeftBehind]:
        for action in in_sight:
            sighted(action)
        return []

    monkeypatch.setattr(module, "cleanup", cleanup)
    assert main(["cleanup"]) == 3
    said = capsys.readouterr()
    assert "no action is in sight in ROS domain 7" in said.err
    assert not said.out
    assert sweep(0.1, 0.1, wanted=()) == 0, "a tree without actions is in nobody's way"
    assert capsys.readouterr().out
    in_sight.append("/move")
    assert main(["cleanup"]) == 0
    assert capsys.readouterr().out == (
        "nothing was left behind on the 1 action in sight in ROS domain 7\n"
    )
