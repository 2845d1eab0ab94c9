"""Which goals of other nodes a line takes upon itself, and for how long it leaves them be.

Asked of one decision at a time, with stand-ins for what is around it; tests/scenarios does it with
real servers, and tests/machine with whole histories.
"""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions.ros import alarm
from bt_actions.ros import line as module
from bt_actions.ros.line import LEASE, Line
from bt_actions.server import ServerWatch

OURS, NEW = b"ours", b"new"


def watch(*shown: bytes, answers: int = 0, ready: bool = True) -> ServerWatch:
    seen = ServerWatch()
    for now in (0.0, 2.0):
        seen.observe(now, ready, frozenset(shown))
    if answers > 1:
        seen.two_answered(answers)
    return seen


@pytest.mark.parametrize(
    ("here", "there", "orphaned", "taken"),
    [
        (watch(OURS), watch(), False, True),
        (watch(), watch(), False, False),
        (watch(OURS, NEW), watch(OURS, NEW), False, False),  # lost there: it is taken for a ghost
        (watch(OURS, NEW, answers=2), watch(OURS, NEW), False, True),
        (watch(OURS, NEW, b"newer", answers=2), watch(OURS, NEW, b"newer"), False, False),
        (watch(OURS), watch(OURS, ready=False), False, True),
        (watch(OURS, ready=False), watch(), False, False),
        (watch(OURS), watch(OURS), True, True),  # whose node is gone sees nothing any more
    ],
    ids=[
        "seen here only",
        "not seen",
        "a ghost",
        "no ghost",
        "a ghost beside two",
        "not ready there",
        "not ready here",
        "orphaned",
    ],
)
def test_a_lost_goal_goes_to_who_sees_more_of_its_server(
    here: ServerWatch, there: ServerWatch, orphaned: bool, taken: bool
) -> None:
    line: Any = SimpleNamespace(watch=here)
    other: Any = SimpleNamespace(watch=there, orphaned=orphaned)
    assert Line._sees_more_than(line, other, frozenset({OURS}), 2.0) is taken


def test_a_goal_that_was_left_is_waited_for_as_long_whoever_adopts_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Runners that are made one after the other, each of which ends before the lease does."""
    monkeypatch.setattr(alarm, "mind", lambda _: None)
    ticket: Any = SimpleNamespace(
        traffic=None,
        begun_at=time.monotonic(),
        not_gone_before=module.NEVER,
        goal=SimpleNamespace(id=b"1"),
        testimony=SimpleNamespace(taken_over=lambda: None),
    )

    def adopt() -> float:
        domain = SimpleNamespace(take_lost=lambda *_: [ticket])
        traffic = SimpleNamespace(domain=domain, made_at=time.monotonic())
        line: Any = SimpleNamespace(traffic=traffic, name="/move", action_type=None, goals={})
        Line._adopt(line)
        until: float = ticket.not_gone_before
        return until

    began = time.monotonic()
    first = adopt()
    assert first >= began + LEASE
    assert adopt() == first
