"""What every Host keeps: that of a process, and that of a run in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from bt_actions.testing.host import VirtualHost
from bt_actions.testing.network import VirtualNetwork
from bt_actions.traffic.state import Entry, Host
from tests.support.waiting import until as until_real

WORLDS = [pytest.param("virtual", id="virtual"), pytest.param("ros", marks=pytest.mark.ros)]


class Due:
    """Something that is to be run again after so many seconds; or never, once it was."""

    def __init__(self, after: float = 3600.0) -> None:
        self.after = after
        self.ran: list[float] = []

    def run_due(self, now: float) -> float:
        self.ran.append(now)
        return self.after


@pytest.fixture(params=WORLDS)
def world(request: pytest.FixtureRequest) -> tuple[Host, Callable[[Callable[[], Any]], None]]:
    """A host of its own, and what waits until something is so."""
    if request.param == "ros":
        from bt_actions.ros.host import RosHost

        return RosHost(), until_real
    network = VirtualNetwork()

    def until(condition: Callable[[], Any]) -> None:
        while not condition():
            assert network.now() < 60.0
            network.timeline.advance(network.now() + 0.1)

    return VirtualHost(network.timeline, network.log), until


def test_what_is_added_is_run_at_once_and_no_more_when_it_is_removed(world: Any) -> None:
    host, until = world
    first, second = Due(0.05), Due(0.05)
    with host.lock:
        host.scheduler.add(first)
        host.scheduler.add(second)
    until(lambda: len(first.ran) > 2 and len(second.ran) > 2)
    with host.lock:
        host.scheduler.remove(first)
        ran = len(first.ran)
        runs = len(second.ran)
    until(lambda: len(second.ran) > runs + 2)
    with host.lock:
        host.scheduler.remove(second)
    assert len(first.ran) == ran
    assert second.ran == sorted(second.ran)


def test_it_is_run_by_the_moment_that_anybody_asks_for(world: Any) -> None:
    host, until = world
    due = Due()
    with host.lock:
        host.scheduler.add(due)
    until(lambda: due.ran)
    with host.lock:
        runs, moment = len(due.ran), host.steady() + 0.02
        host.scheduler.wake_by(moment)
    until(lambda: len(due.ran) > runs and due.ran[-1] >= moment)
    with host.lock:
        host.scheduler.remove(due)
    if isinstance(host, VirtualHost):  # where no thread can be late
        assert due.ran[runs] == pytest.approx(moment)


def test_who_holds_the_lock_may_take_it_again_and_wait_for_a_change(world: Any) -> None:
    host, _ = world
    with host.lock, host.lock:
        before = host.steady()
        host.notify_all()
        host.wait(0.01)
        assert host.steady() >= before


def test_ids_are_of_sixteen_bytes_and_none_comes_twice(world: Any) -> None:
    host, _ = world
    ids = [host.new_goal_id() for _ in range(100)]
    assert {len(each) for each in ids} == {16}
    assert len(set(ids)) == len(ids)


def test_a_domain_is_one_however_often_it_is_asked_for(world: Any) -> None:
    host, _ = world
    assert host.domain(1) is host.domain(1)
    assert host.domain(1) is not host.domain(2)


def test_a_new_one_is_of_no_fork_and_does_not_close(world: Any) -> None:
    host, _ = world
    assert (host.forks, host.closing) == (0, False)
    host.record.enter(b"id", Entry("/move", 1, frozenset({b"server"})))
    host.record.strike(b"id")
    assert b"id" not in host.record
    for line in (host.log.info, host.log.warning, host.log.error):
        line("of each level")
