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


def test_work_of_a_burst_gathers_until_the_burst_is_over() -> None:
    def step(last: bool) -> None:
        steps.append(len(asked))
        done.set()

    def is_burst() -> bool:
        asked.append(True)
        return len(asked) < 4

    steps, asked, done = list[int](), list[bool](), threading.Event()
    batches = Batches("worker", step, is_burst)
    batches.start()
    assert done.wait(9.0)
    done.clear()
    batches.poke()
    assert done.wait(9.0)
    batches.close(9.0)
    assert steps[:2] == [0, 4]


def test_work_of_a_burst_without_end_is_done_all_the_same() -> None:
    steps, done = list[bool](), threading.Event()

    def step(last: bool) -> None:
        steps.append(last)
        if len(steps) == 3:
            done.set()
        batches.poke()

    batches = Batches("worker", step, lambda: True)
    batches.start()
    assert done.wait(9.0)
    batches.close(9.0)
