"""The topics of a node's runs: what subscribers are told, from whenever they come."""

from __future__ import annotations

import dataclasses
import itertools
import logging
import time
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import Mock

import pytest
from bt_actions_interfaces.msg import RunEvent
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.events import Event, EventsLost, NodeChanged, Paused, RunBegan, RunEnded, to_line
from bt_actions.events.bare import bare
from bt_actions.events.stream import Stream
from bt_actions.ros import run_topics
from bt_actions.ros.run_topics import RunTopics
from bt_actions.story.keeping import to_json
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.listener import Listener
from tests.support.stories import state_of
from tests.support.waiting import holds_for, until

EVENTS = [each for each in every_kind(rounds=3) if not isinstance(each, EventsLost)]
OTHER = "ee" * 16


class Run:
    """A run whose events the test tells."""

    def __init__(self, run_id: str = RUN_ID) -> None:
        self.stream = Stream(lambda: (time.monotonic(), time.time(), time.time()))
        self._run_id = run_id
        self.told: list[Event] = []
        self._copy = self.stream.reader()

    def tell(self, *events: Event) -> None:
        for event in events:
            fields = [getattr(event, each.name) for each in dataclasses.fields(event)][1:]
            if isinstance(event, RunBegan):
                fields[0] = self._run_id
            self.stream.add(type(event), *fields)
        self.told += self._copy.take()


def published(events: list[Event]) -> list[Event]:
    """Tree files are not published: a secret's default may stand there."""
    return [
        dataclasses.replace(each, sources={}) if isinstance(each, RunBegan) else each
        for each in events
    ]


def all_after(number: int, run: Run) -> list[int]:
    return [each.at.number for each in run.told if each.at.number > number]


@pytest.fixture
def ours(context: Any, name: str, no_leaks: None) -> Iterator[Node]:
    """The node of the runs, which nobody spins."""
    node = Node("runs", context=context, namespace=name.rpartition("/")[0])
    yield node
    node.destroy_node()


@pytest.fixture
def topics(ours: Node, request: pytest.FixtureRequest) -> Iterator[RunTopics]:
    topics = RunTopics(ours, values=getattr(request, "param", True))
    yield topics
    topics.close()


@pytest.fixture
def listen(context: Any, ours: Node) -> Iterator[Callable[[], Listener]]:
    """Make somebody who listens; all of them hear while a test waits with `until`."""
    executor = SingleThreadedExecutor(context=context)
    nodes: list[Node] = []

    def make() -> Listener:
        nodes.append(Node(f"listener_{len(nodes)}", context=context))
        executor.add_node(nodes[-1])
        return Listener(nodes[-1], ours.get_fully_qualified_name())

    make.executor = executor  # type: ignore[attr-defined]
    yield make
    executor.shutdown()
    for each in nodes:
        each.destroy_node()


@pytest.fixture
def hears(listen: Any) -> Callable[..., Any]:
    """Wait for what somebody hears."""
    return lambda condition, what="": until(
        condition, what=what, meanwhile=lambda: listen.executor.spin_once(timeout_sec=0.02)
    )


def test_each_event_is_told_whole_and_the_state_goes_along(
    topics: RunTopics, listen: Callable[[], Listener], hears: Any
) -> None:
    listener, run = listen(), Run()
    hears(lambda: listener.trees, "that nothing runs")
    assert listener.trees[0].runs == []
    topics.follow(run.stream)
    run.tell(*EVENTS)
    hears(lambda: len(listener.events) == len(run.told))
    assert listener.numbers == [each.at.number for each in run.told]
    assert [each.kind for each in listener.events] == [type(each).__name__ for each in run.told]
    assert [each.data for each in listener.events] == list(map(to_line, published(run.told)))
    assert {bytes(each.run_id).hex() for each in listener.events} == {RUN_ID}
    changes = [each for each in run.told if isinstance(each, NodeChanged)]
    assert [(each.node, each.status) for each in listener.events if each.status] == [
        (each.node, getattr(RunEvent, each.status.name)) for each in changes
    ]
    hears(lambda: listener.runs[RUN_ID].ended)
    assert listener.trees[-1].runs[0].number == run.told[-1].at.number
    assert to_json(listener.runs[RUN_ID]) == to_json(state_of(published(run.told)))


def test_who_comes_late_gets_a_state_and_goes_on_from_its_number_without_a_gap(
    topics: RunTopics, listen: Callable[[], Listener], hears: Any
) -> None:
    first, run = listen(), Run()
    topics.follow(run.stream)
    run.tell(*EVENTS[:9])
    hears(lambda: first.trees and first.trees[-1].runs, "a state that is kept")
    run.tell(*EVENTS[9:12])
    hears(lambda: first.numbers[-1:] == [12], "events behind it")
    middle, end = itertools.cycle(EVENTS[2:12]), EVENTS[-2:]
    late = listen()

    def goes_on() -> bool:
        run.tell(next(middle))
        return RUN_ID in late.runs and len(late.events) > 3

    hears(goes_on, "the late one hears")
    run.tell(*end)
    hears(lambda: late.runs[RUN_ID].ended and late.numbers[-1] == len(run.told))
    states = [each.runs[0].number for each in late.trees[:2]]
    assert any(late.numbers[-(len(run.told) - at) :] == all_after(at, run) for at in states)
    assert to_json(late.runs[RUN_ID]) == to_json(state_of(published(run.told)))


def test_what_this_process_was_too_slow_for_is_a_gap_that_a_state_fills(
    topics: RunTopics, listen: Callable[[], Listener], hears: Any
) -> None:
    listener, run = listen(), Run()
    hears(lambda: listener.trees)
    topics.follow(run.stream)
    (reader,) = (each for each in run.stream._readers if each is not run._copy)
    run.tell(*EVENTS[:9])
    hears(lambda: listener.runs)
    reader._room = 0
    changes = [each for each in EVENTS if isinstance(each, NodeChanged)]
    run.tell(*[each for each in changes if each.status.name == "RUNNING"])
    reader._room = 1000
    run.tell(Paused(EVENTS[0].at, True))
    hears(lambda: listener.runs[RUN_ID].lost, "a state")
    hears(lambda: listener.numbers[-1] == len(run.told), "the event behind the gap")
    assert listener.numbers == sorted(set(listener.numbers)), "each number once"
    assert listener.numbers != all_after(listener.numbers[0] - 1, run)


@pytest.mark.parametrize("topics", [False], indirect=True)
def test_without_values_numbers_have_no_gap_and_what_nobody_may_know_is_a_kind(
    topics: RunTopics, listen: Callable[[], Listener], hears: Any
) -> None:
    listener, run = listen(), Run()
    hears(lambda: listener.trees)
    topics.follow(run.stream)
    run.tell(*EVENTS)
    hears(lambda: len(listener.events) == len(run.told))
    known = [bare(each) for each in run.told]
    assert [each.data for each in listener.events] == [
        "" if each is None else to_line(each) for each in known
    ]
    assert "" in [each.data for each in listener.events]
    assert listener.numbers == all_after(0, run)
    hears(lambda: listener.trees[-1].runs[0].number == len(run.told))
    state = state_of(each for each in known if each is not None)
    assert listener.trees[-1].runs[0].data == to_json(state)


def test_of_the_runs_that_have_ended_the_latest_stays(
    topics: RunTopics, listen: Callable[[], Listener], hears: Any
) -> None:
    runs = {run_id: Run(run_id) for run_id in (RUN_ID, OTHER, "dd" * 16)}
    for run in runs.values():
        topics.follow(run.stream)
        run.tell(*EVENTS[:9])
    listener = listen()
    hears(lambda: listener.trees and len(listener.trees[-1].runs) == 3)
    ends = EVENTS[-2:]
    runs[OTHER].tell(*ends)
    hears(lambda: listener.runs[OTHER].ended)
    runs[RUN_ID].tell(*ends)
    hears(lambda: listener.runs[RUN_ID].ended and len(listener.trees[-1].runs) == 2)
    there = {bytes(each.run_id).hex() for each in listener.trees[-1].runs}
    assert there == {RUN_ID, "dd" * 16}
    assert not runs[RUN_ID].stream._readers or runs[RUN_ID].stream._readers == (
        runs[RUN_ID]._copy,
    ), "its reader is gone"


def test_where_nobody_subscribes_nothing_is_encoded(
    topics: RunTopics,
    listen: Callable[[], Listener],
    hears: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    encoded = Mock(side_effect=AssertionError)
    with monkeypatch.context() as patch:
        for name in ("to_line", "to_json", "RunEvent", "RunStates"):
            patch.setattr(run_topics, name, encoded)
        run = Run()
        topics.follow(run.stream)
        run.tell(*EVENTS[:-1])
        (reader,) = (each for each in run.stream._readers if each is not run._copy)
        until(lambda: not reader._events, what="all is taken")
        assert holds_for(lambda: not encoded.called, 0.2)
    listener = listen()
    hears(lambda: RUN_ID in listener.runs, "the state was folded")
    assert listener.runs[RUN_ID].finished is not None
    assert listener.events == []


def test_to_close_publishes_what_has_come(
    ours: Node, listen: Callable[[], Listener], hears: Any
) -> None:
    topics, listener, run = RunTopics(ours, values=True), listen(), Run()
    hears(lambda: listener.trees)
    topics.follow(run.stream)
    run.tell(*EVENTS)
    topics.close()
    hears(lambda: len(listener.events) == len(run.told))
    assert any(each.kind == RunEnded.__name__ for each in listener.events)
    assert ours.count_publishers(f"{ours.get_fully_qualified_name()}/events") == 0


@pytest.fixture
def logged(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is logged of bugs."""
    lines = list[str]()
    monkeypatch.setattr(
        logging.getLogger("bt_actions"), "error", lambda text, *told: lines.append(text % told)
    )
    return lines


def test_an_event_that_cannot_be_published_is_logged_and_costs_no_other_one(
    topics: RunTopics,
    listen: Callable[[], Listener],
    hears: Any,
    monkeypatch: pytest.MonkeyPatch,
    logged: list[str],
) -> None:
    def line(event: Event) -> str:
        return str(1 / 0) if event.at.number == 3 else to_line(event)

    monkeypatch.setattr(run_topics, "to_line", line)
    listener, run = listen(), Run()
    hears(lambda: listener.trees)
    topics.follow(run.stream)
    run.tell(*EVENTS)
    hears(lambda: listener.numbers[-1:] == [len(run.told)])
    assert listener.numbers == [each.at.number for each in run.told if each.at.number != 3]
    assert ["ZeroDivisionError" in each for each in logged] == [True]


def test_in_a_context_that_was_shut_down_nothing_is_said(domain: int, logged: list[str]) -> None:
    context = Context()
    context.init(domain_id=domain)
    node = Node("short_lived", context=context)
    topics, run = RunTopics(node), Run()
    topics.follow(run.stream)
    context.shutdown()
    run.tell(*EVENTS)
    topics.close()
    node.destroy_node()
    assert logged == []


def test_the_state_is_kept_for_who_comes_late_and_events_are_not(
    ours: Node, topics: RunTopics
) -> None:
    base = ours.get_fully_qualified_name()
    (events,) = ours.get_publishers_info_by_topic(f"{base}/events")
    (states,) = ours.get_publishers_info_by_topic(f"{base}/tree")
    assert events.qos_profile.durability is DurabilityPolicy.VOLATILE
    assert states.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    assert events.qos_profile.reliability == QoSProfile(depth=1).reliability
