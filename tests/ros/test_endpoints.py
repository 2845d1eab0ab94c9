"""A callback that awaits what another thread does."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import pytest

pytestmark = pytest.mark.ros


class Executor:
    """One that does nothing until it is woken."""

    context = SimpleNamespace(ok=lambda: True)

    def __init__(self) -> None:
        self.woken = threading.Event()

    def wake(self) -> None:
        self.woken.set()


def test_an_executor_is_woken_at_once_when_what_a_callback_awaits_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from bt_actions.ros.serving import endpoints

    monkeypatch.setattr(endpoints, "_NUDGE", 600.0)
    executor, awaited, threads = Executor(), threading.Event(), []

    def submit(work: Any) -> None:
        threads.append(threading.Thread(target=work, daemon=True))
        threads[-1].start()

    node: Any = SimpleNamespace(executor=executor)
    callback = endpoints.Endpoints(node).off(submit, lambda: awaited.wait(5.0))
    callback.send(None)
    awaited.set()
    assert executor.woken.wait(5.0)
    with pytest.raises(StopIteration) as returned:
        callback.send(None)
    assert returned.value.value is True
    threads[0].join()
