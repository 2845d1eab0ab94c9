"""A thread that does in batches what others queue for it."""

from __future__ import annotations

import logging
import threading

import pytest

from bt_actions.utilities.batches import Batches


def test_work_that_raises_is_logged_and_later_work_is_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def step(last: bool) -> None:
        steps.append(last)
        if len(steps) == 1:
            news.set()
            raise KeyError(3)

    steps, lines = list[bool](), list[str]()
    monkeypatch.setattr(
        logging.getLogger("bt_actions"), "error", lambda text, *told: lines.append(text % told)
    )
    batches, news = Batches("worker", step), threading.Event()
    batches.start()
    assert news.wait(9.0)
    batches.close(9.0)
    assert len(steps) > 1
    assert steps[-1], "its last step was done"
    [line] = lines
    assert line.startswith("the thread worker goes on after Traceback")
    assert line.endswith("KeyError: 3\n")
