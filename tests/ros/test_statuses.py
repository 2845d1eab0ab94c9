"""A server's statuses are read without objects, and come out as rclpy's own do."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray

from bt_actions.ros.workarounds import statuses
from bt_actions.ros.workarounds.statuses import by_objects, status_reader
from tests.support.waiting import until


def message(goals: int) -> GoalStatusArray:
    entries = [GoalStatus(status=number % 7) for number in range(goals)]
    for number, entry in enumerate(entries):
        entry.goal_info.goal_id.uuid = [number, *range(100, 115)]
        entry.goal_info.stamp.sec, entry.goal_info.stamp.nanosec = number - 3, 2**32 - 1 - number
    return GoalStatusArray(status_list=entries)


@pytest.mark.parametrize("goals", [0, 1, 150])
def test_both_ways_read_the_same_of_what_comes_over_the_wire(
    node: Any, name: str, goals: int
) -> None:
    publisher = node.create_publisher(GoalStatusArray, name, 10)
    subscription = node.create_subscription(GoalStatusArray, name, lambda _: None, 10)
    kind, read = status_reader()
    assert kind is not GoalStatusArray
    taken: list[Any] = []

    def comes() -> bool:
        with subscription.handle:
            if (found := subscription.handle.take_message(kind, False)) is not None:
                taken.append(read(found[0]))
        return bool(taken)

    try:
        until(lambda: publisher.get_subscription_count() > 0)
        publisher.publish(message(goals))
        until(comes)
    finally:
        node.destroy_publisher(publisher)
        node.destroy_subscription(subscription)
    assert taken == [by_objects(message(goals))]
    assert len(taken[0]) == goals


def test_where_the_layout_is_another_one_the_objects_are_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(statuses, "STATUS", 20)
    status_reader.cache_clear()
    try:
        kind, read = status_reader()
    finally:
        status_reader.cache_clear()
    assert kind is GoalStatusArray
    assert read(message(3)) == by_objects(message(3))
