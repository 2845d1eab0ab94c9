"""What is made of messages that come while a leaf waits, and while it does not. In virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from py_trees.common import Status
from std_msgs.msg import Int32

from bt_actions.behaviours.topics import KEPT, WaitForMessage
from bt_actions.testing import VirtualBackend, VirtualNetwork

Publish = Callable[[int], None]


@pytest.fixture
def backend() -> VirtualBackend:
    return VirtualBackend(VirtualNetwork())


@pytest.fixture
def publish(backend: VirtualBackend) -> Publish:
    """Publish a number, and let it arrive."""
    network = backend.network

    def publish(number: int) -> None:
        network.publish("level", Int32(data=number))
        network.timeline.advance(network.now() + 0.1)

    return publish


def test_a_message_that_fits_is_found_though_others_follow_it_before_the_next_tick(
    backend: VirtualBackend, publish: Publish
) -> None:
    def read(message: Int32) -> str:
        return "" if message.data == 2 else "another"

    waits = WaitForMessage("w", Int32, "level", qos="default", timeout=None, read=read)
    waits.setup(node=backend)
    publish(2)  # before it waits
    waits.tick_once()
    for number in (1, 2, 3):
        publish(number)
    assert waits.status is Status.RUNNING
    waits.tick_once()
    assert waits.status is Status.SUCCESS
    waits.shutdown()


def test_the_newest_messages_are_kept_for_who_waits(
    backend: VirtualBackend, publish: Publish
) -> None:
    seen: list[int] = []

    def read(message: Int32) -> str:
        seen.append(message.data)
        return "another"

    waits = WaitForMessage("w", Int32, "level", qos="default", timeout=None, read=read)
    waits.setup(node=backend)
    publish(-1)
    waits.tick_once()
    for number in range(KEPT + 2):
        publish(number)
    waits.tick_once()
    assert seen == list(range(2, KEPT + 2))
    waits.shutdown()


def test_messages_that_came_before_it_began_are_told(
    backend: VirtualBackend, publish: Publish
) -> None:
    waits = WaitForMessage("w", Int32, "level", qos="default", timeout=0.05, read=str)
    waits.setup(node=backend)
    publish(1)
    waits.tick_once()
    backend.network.timeline.advance(backend.network.now() + 0.05)
    waits.tick_once()
    assert waits.status is Status.FAILURE
    assert waits.feedback_message == (
        "no such message on /level within 0.05 s; 1 came before it began"
    )
    waits.shutdown()
