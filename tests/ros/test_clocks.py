"""A node's two clocks, where simulated time does not come."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from bt_actions.ros import clocks


def test_simulated_time_that_nobody_publishes_is_told_once_after_a_moment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said, steady = list[str](), [100.0]
    monkeypatch.setattr(clocks.log, "warning", said.append)
    monkeypatch.setattr(clocks, "time", SimpleNamespace(monotonic=lambda: steady[0]))
    ros = SimpleNamespace(ros_time_is_active=True, now=lambda: SimpleNamespace(nanoseconds=0))
    read = clocks.Clocks(SimpleNamespace(get_clock=lambda: ros))
    for seconds in (0.0, 0.9 * clocks.MOMENT):
        steady[0] += seconds
        assert read.now().ros == 100.0
    assert said == [], "it may only not have been discovered yet"
    for _ in range(3):
        steady[0] += clocks.MOMENT
        read.now()
    assert len(said) == 1
    assert "no message has come on /clock" in said[0]
