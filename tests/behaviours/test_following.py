"""Goals that follow variables: rules 1 to 8 of a goal's life hold for each of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from bt_actions import ActionBehaviour, Outcome, Timeouts
from bt_actions.events import GoalChanged
from tests.support.trees import Gate, Guard
from tests.support.virtual import Runner

if TYPE_CHECKING:
    from tests.support.processes import Journal
    from tests.support.virtual import World

FOLLOWS = pytest.mark.parametrize("on_change", ["replace", "cancel"])
SERVERS = pytest.mark.parametrize("preempts", [True, False], ids=["preempts", "runs both"])


class Follower:
    """A leaf whose goal is what `wanted` holds, and the server that it sends it to."""

    def __init__(self, world: World, on_change: str, *faults: str, **more: Any) -> None:
        preempts = more.pop("preempts", True)
        self.wanted = 5.0
        self.journal: Journal = world.serve(*faults, preempts=preempts)
        self.server = world.servers["/move_robot"]
        self.leaf = ActionBehaviour(
            "follow", self.server.action_type, "move_robot", self._goal,
            on_change=on_change, **more,
        )  # fmt: skip
        self.runner: Runner = world.runner(self.leaf)
        self.runner.start()

    def _goal(self) -> dict[str, float]:
        if self.wanted < 0.0:
            raise ValueError("nothing is wanted")
        return {"distance": self.wanted}

    def want(self, distance: float, after: float = 1.0) -> None:
        self.runner.advance(after)
        self.wanted = distance

    def end(self, within: float = 60.0) -> Status:
        status = self.runner.run(within)
        assert not self.server.live_goals, "nothing is left live"
        assert not self.runner.unaccounted
        return status

    @property
    def sent(self) -> list[float]:
        """The distances of the goals that were sent, in order."""
        return [
            event.goal["distance"]
            for event in self.runner.events
            if isinstance(event, GoalChanged) and event.state == "SENDING"
        ]


@FOLLOWS
@SERVERS
def test_the_newest_goal_alone_counts_and_no_attempt_is_used(
    world: World, on_change: str, preempts: bool
) -> None:
    it = Follower(world, on_change, preempts=preempts)
    it.want(2.0)
    assert it.end() is Status.SUCCESS
    assert it.sent == [5.0, 2.0]
    assert it.leaf.result.final_pose == 2.0
    assert [(one.attempt, one.outcome) for one in it.leaf.history] == [(1, Outcome.SUCCEEDED)]
    assert it.journal.max_live <= (1 if on_change == "cancel" else 2)


def test_what_is_ignored_runs_to_its_end(world: World) -> None:
    it = Follower(world, "ignore")
    it.want(2.0)
    assert it.end() is Status.SUCCESS
    assert it.sent == [5.0]


def test_a_goal_that_is_to_be_canceled_has_ended_before_the_next_is_sent(world: World) -> None:
    it = Follower(world, "cancel", "1:delay_cancel=2", preempts=False)
    it.want(2.0)
    assert it.end() is Status.SUCCESS
    assert it.journal.max_live == 1


@FOLLOWS
@SERVERS
def test_of_changes_at_a_hundred_hertz_the_newest_wins_and_two_goals_live_at_most(
    world: World, on_change: str, preempts: bool
) -> None:
    it = Follower(world, on_change, "*:delay_accept=0.1", preempts=preempts)
    for step in range(300):
        it.want(3.0 + step / 100.0, after=0.01)
    assert it.end() is Status.SUCCESS
    assert it.sent[-1] == it.leaf.result.final_pose == 3.0 + 299 / 100.0
    assert 2 < len(it.sent) < 40, "a change waits for the answer of what is being sent"
    assert it.journal.max_live <= 2


@FOLLOWS
def test_a_goal_that_cannot_be_built_is_not_sent_and_the_old_one_runs_on(
    world: World, on_change: str
) -> None:
    it = Follower(world, on_change)
    it.want(-1.0)
    assert it.end() is Status.SUCCESS
    assert it.sent == [5.0]


@FOLLOWS
@SERVERS
def test_a_refused_goal_ends_the_leaf_and_what_it_was_to_replace(
    world: World, on_change: str, preempts: bool
) -> None:
    it = Follower(world, on_change, "2:reject", preempts=preempts)
    it.want(2.0)
    assert it.end() is Status.FAILURE
    assert it.leaf.outcome is Outcome.REJECTED
    assert it.runner.now < 4.0


def test_a_goal_that_has_ended_before_it_was_replaced_does_not_count(world: World) -> None:
    it = Follower(world, "replace", "2:delay_accept=2", preempts=False)
    it.want(1.0, after=4.5)
    assert it.end() is Status.SUCCESS
    assert (it.sent, it.leaf.result.final_pose) == ([5.0, 1.0], 1.0)


@FOLLOWS
def test_a_server_that_dies_ends_the_leaf(world: World, on_change: str) -> None:
    it = Follower(world, on_change, "2:die")
    it.want(2.0)
    assert it.runner.run(200.0) is Status.FAILURE
    assert it.leaf.outcome in (Outcome.SERVER_LOST, Outcome.SERVER_UNAVAILABLE)


@FOLLOWS
@pytest.mark.parametrize("after", [0.0, 0.05, 0.5, 1.5])
def test_what_is_stopped_in_any_phase_leaves_nothing_live(
    world: World, on_change: str, after: float
) -> None:
    it = Follower(world, on_change, "*:delay_accept=0.3", "*:delay_cancel=0.2", preempts=False)
    it.want(2.0)
    it.runner.advance(after)
    it.runner.interrupt()
    it.runner.run()
    assert not it.server.live_goals
    assert not it.runner.unaccounted
    assert it.leaf.drained


@FOLLOWS
def test_the_deadline_of_the_result_runs_on(world: World, on_change: str) -> None:
    it = Follower(world, on_change, timeout=Timeouts(result=4.0))
    for _ in range(5):
        it.want(it.wanted + 1.0, after=0.7)
    assert it.end() is Status.FAILURE
    assert it.leaf.outcome is Outcome.RESULT_TIMEOUT
    assert it.runner.now < 6.0


def test_a_replaced_goal_that_does_not_end_is_canceled(world: World) -> None:
    it = Follower(world, "replace", preempts=False, timeout=Timeouts(cancel=1.0))
    it.wanted = 50.0
    it.want(3.0)
    assert it.end() is Status.SUCCESS
    assert sorted(map(str, it.journal.ends())) == ["canceled", "succeeded"]


def test_a_stamp_of_now_is_no_difference(world: World) -> None:
    it = Follower(world, "replace")
    it.want(5.0)
    assert it.end() is Status.SUCCESS
    assert it.sent == [5.0]


def test_a_word_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="on_change is one of ignore, replace, cancel, not 'now'"):
        ActionBehaviour("a", "a/action/B", "b", {}, on_change="now")


@FOLLOWS
def test_a_change_is_seen_though_nothing_wakes_the_tree(world: World, on_change: str) -> None:
    it = Follower(world, on_change)
    it.want(2.0, after=0.5)
    it.runner.advance(0.5)
    assert it.sent == [5.0, 2.0]


def in_a_tree(world: World, *faults: str) -> tuple[Selector, Guard, list[float], Journal]:
    """A leaf that replaces, below a guard, in a tree that goes on without it."""
    journal = world.serve(*faults, preempts=False)
    wanted, guard = [5.0], Guard()
    guard.holds = True
    leaf = ActionBehaviour(
        "follow", world.servers["/move_robot"].action_type, "move_robot",
        lambda: {"distance": wanted[0]}, on_change="replace",
    )  # fmt: skip
    guarded = Sequence("g", memory=False, children=[guard, leaf])
    return Selector("s", True, children=[guarded, Gate()]), guard, wanted, journal


def test_what_a_refused_goal_was_to_replace_is_canceled_while_the_tree_goes_on(
    world: World,
) -> None:
    root, _, wanted, journal = in_a_tree(world, "2:reject")
    with world.runner(root) as runner:
        runner.start()
        runner.advance(1.0)
        wanted[0] = 2.0
        runner.advance(1.0)
        assert root.status is Status.RUNNING
        assert journal.ends() == ["canceled", "rejected"]


def test_what_is_stopped_while_it_replaces_leaves_neither_goal_while_the_tree_goes_on(
    world: World,
) -> None:
    root, guard, wanted, journal = in_a_tree(world, "2:delay_accept=3")
    with world.runner(root) as runner:
        runner.start()
        runner.advance(1.0)
        wanted[0] = 2.0
        runner.advance(0.5)
        guard.holds = False
        runner.advance(1.0)
        assert root.status is Status.RUNNING
        assert journal.ends()[0] == "canceled", "though the newer one is not accepted yet"
        runner.advance(5.0)
        assert journal.ends() == ["canceled", "canceled"]


@pytest.mark.parametrize("is_stopped", [True, False], ids=["stopped", "succeeded"])
def test_a_goal_that_was_replaced_does_not_outlive_its_leaf(world: World, is_stopped: bool) -> None:
    root, guard, wanted, journal = in_a_tree(world)
    later = Sequence("later", memory=True, children=[root, Gate()])
    with world.runner(later) as runner:
        runner.start()
        runner.advance(1.0)
        wanted[0] = 3.0 if is_stopped else 0.5
        runner.advance(0.4)
        assert journal.max_live == 2
        guard.holds = not is_stopped
        runner.advance(0.6)
        assert later.status is Status.RUNNING
        assert journal.ends() == ["canceled", "canceled" if is_stopped else "succeeded"]
