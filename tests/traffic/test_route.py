"""An endpoint that goes on in another participant loses nothing that is under way."""

from __future__ import annotations

import pytest

from bt_actions import Busy, MoveRobot, Outcome
from bt_actions.testing.transport import VirtualParticipant, VirtualTransport
from bt_actions.traffic import route, watcher
from tests.support.trees import together
from tests.support.virtual import World


def move(leaf: MoveRobot, world: World) -> tuple[VirtualTransport, VirtualTransport]:
    """Have the leaf's endpoint use a second participant; return both transports."""
    endpoint, former = leaf._own, leaf._own.transport
    second = VirtualParticipant(world.network, "second", "/")
    transport = second.open_transport(*endpoint.action, endpoint)
    route.begin_trial(endpoint, transport)
    watcher.move_to(endpoint, transport)
    assert isinstance(former, VirtualTransport)
    assert isinstance(leaf._own.transport, VirtualTransport)
    return former, leaf._own.transport


@pytest.mark.parametrize(
    ("distance", "outcome"), [(101.0, Outcome.REJECTED), (0.5, Outcome.SUCCEEDED)]
)
def test_a_goal_request_that_is_under_way_is_answered_where_it_was_sent(
    world: World, monkeypatch: pytest.MonkeyPatch, distance: float, outcome: Outcome
) -> None:
    """Nobody may spin the participant of before, either: what has come there is taken by hand."""
    taken = list[float]()
    journal = world.serve("1:delay_accept=2")
    leaf = MoveRobot("m", distance)
    with world.runner(leaf) as runner:
        runner.start()
        runner.until(lambda: journal.events() == ["received"])
        former, later = move(leaf, world)
        assert not former.closed
        monkeypatch.setattr(former, "deliver_arrived", lambda: taken.append(runner.now))
        runner.wait(10.0)
    assert leaf.outcome is outcome
    assert taken
    assert former.closed
    assert later.closed


def test_feedback_is_heard_once_while_a_goal_request_is_under_way(world: World) -> None:
    world.serve("2:delay_accept=1")
    poses = list[float]()
    first = MoveRobot(
        "first",
        2.0,
        busy=Busy.SHARE,
        on_feedback=lambda each: poses.append(each.current_pose),
    )
    second = MoveRobot("second", 0.1, busy=Busy.SHARE)
    with world.runner(together(first, second)) as runner:
        runner.start()
        runner.until(lambda: poses and second.progress().state == "SENDING")
        former, _ = move(first, world)
        runner.until(lambda: len(poses) > 5)
        assert second.progress().state == "SENDING"
        assert not former.closed
        runner.wait(10.0)
    assert len(poses) == len(set(poses))
