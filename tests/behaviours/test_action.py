"""What a user of the leaf sees, beyond outcomes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from py_trees.common import Status

from bt_actions import ActionBehaviour, MoveRobot, Outcome, Retry, Timeouts
from bt_actions.testing import VirtualBackend, VirtualNetwork
from tests.support.trees import started, state, together
from tests.support.waiting import until

if TYPE_CHECKING:
    from tests.support.virtual import World


@pytest.fixture
def backend(world: World) -> VirtualBackend:
    return VirtualBackend(world.network)


def test_an_unexpected_result_says_what_was_expected_and_what_came(world: World) -> None:
    world.serve()
    leaf = world.run(MoveRobot("m", 0.1, expect="result.final_pose > 4.0"))
    assert leaf.outcome is Outcome.UNEXPECTED_RESULT
    assert leaf.reason.startswith("result.final_pose > 4.0 was expected, but the result is: ")
    assert "final_pose: 0.1" in leaf.reason


@pytest.mark.parametrize(
    ("fault", "settings", "reason"),
    [
        ("reject", {}, "/move_robot refused the goal {distance: 2.5}"),
        ("abort", {}, "aborted by /move_robot; goal {distance: 2.5}; its result is: {"),
        ("stall", {"timeout": 4.0}, "not finished within 4 s; goal {distance: 2.5}"),
        (
            "stall",
            {"timeout": Timeouts(feedback=2.0)},
            "no feedback for 2 s; goal {distance: 2.5}",
        ),
        ("", {"expect": "result.final_pose < 0.0"}, "; goal {distance: 2.5}"),
    ],
)
def test_a_reason_that_blames_a_goal_tells_its_fields(
    world: World, fault: str, settings: dict[str, Any], reason: str
) -> None:
    world.serve(*([f"*:{fault}"] if fault else []))
    leaf = world.run(MoveRobot("m", 2.5, **settings))
    assert reason in leaf.reason
    assert leaf.history[0].goal.message is None, "it is not kept"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"goal": {"distanse": 1.0}}, "goal: distanse: MoveRobot.Goal has no field 'distanse'; "),
        ({"goal": {"distance": "far"}}, "goal: distance: "),
        ({"expect": "result.statsu == 0"}, "expect: result has no field 'statsu'; did you mean "),
        ({"retry": Retry(2, when="result.statsu == 0")}, "retry.when: result has no field"),
        ({"save": {"pose": "result.pose"}}, "save: result has no field 'pose'"),
    ],
)
def test_what_does_not_fit_the_action_is_found_in_setup(
    backend: VirtualBackend, settings: dict[str, Any], message: str
) -> None:
    """And not when a goal has moved the robot already."""
    wanted = {"goal": {"distance": 1.0}, **settings}
    leaf = ActionBehaviour("m", "robot_control_interfaces/MoveRobot", "move", **wanted)
    with pytest.raises(ValueError, match="m: ") as raised:
        leaf.setup(node=backend)
    assert message in str(raised.value)


def test_a_tick_before_setup_says_what_is_wrong() -> None:
    with pytest.raises(RuntimeError, match="setup"):
        MoveRobot("m", 1.0).tick_once()


def test_setup_without_a_node_says_what_is_wrong() -> None:
    with pytest.raises(TypeError, match="node"):
        MoveRobot("m", 1.0).setup()


def test_constants_of_a_result_are_known(backend: VirtualBackend) -> None:
    MoveRobot("m", 1.0, expect="result.status != result.STATUS_FAULT").setup(node=backend)


def test_the_first_leaf_that_is_shut_down_closes_for_the_whole_tree(world: World) -> None:
    world.serve("*:reject_cancel")
    leaves = [
        MoveRobot(f"m{n}", 60.0, busy="share", timeout=Timeouts(cancel=2.0)) for n in range(5)
    ]
    runner = world.runner(together(*leaves))
    runner.start()
    runner.until(lambda: all(state(leaf) == "EXECUTING" for leaf in leaves))
    began = runner.now
    leaves[0].shutdown()
    assert runner.now - began == pytest.approx(2.1, abs=0.1), "all are waited for together"
    for leaf in leaves:
        leaf.shutdown()
    assert runner.now - began == pytest.approx(2.1, abs=0.1)


def test_a_tick_begins_one_more_attempt_at_most(backend: VirtualBackend) -> None:
    first = MoveRobot("first", 1.0)
    second = MoveRobot("second", 1.0, busy="fail", retry=1000)
    for leaf in (first, second):
        leaf.setup(node=backend)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING
    assert [each.outcome for each in second.history] == [Outcome.SERVER_BUSY] * 2
    second.tick_once()
    assert len(second.history) == 3


def test_a_visit_whose_first_tick_breaks_off_is_interrupted_by_the_next(
    world: World, backend: VirtualBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C in a notebook, which ticks on: no status is set yet, and nobody stops the leaf."""
    journal = world.serve()
    leaf = MoveRobot("m", 3.0)
    leaf.setup(node=backend)
    advance = backend.traffic.advance

    def interrupted(*given: Any) -> None:
        advance(*given)
        raise KeyboardInterrupt

    monkeypatch.setattr(backend.traffic, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        leaf.tick_once()
    monkeypatch.undo()
    leaf.goal = {"distance": 0.1}
    while leaf.status is not Status.SUCCESS:
        leaf.tick_once()
        world.network.timeline.advance(world.network.now() + 0.1)
    assert journal.ends() == ["canceled", "succeeded"]
    leaf.shutdown()


def test_a_name_of_the_nodes_own() -> None:
    leaf = MoveRobot("m", 1.0, action_name="~/dock")
    leaf.setup(node=VirtualBackend(VirtualNetwork("r1")))
    assert leaf.server == "/r1/tree/dock"


def test_a_name_that_ros_refuses_is_refused_in_setup(node: Any) -> None:
    with pytest.raises(ValueError, match="topic name 'a b' is invalid"):
        MoveRobot("m", 1.0, action_name="a b").setup(node=node)


def test_a_loop_that_stands_still_is_not_told_of_another_type(
    host: Any, name: str, node: Any
) -> None:
    host.open(name)
    leaf = MoveRobot("m", 1.0, action_name=name, timeout=Timeouts(server=0.5))
    leaf.setup(node=node)
    until(leaf._own.transport.ready)
    leaf.initialise()  # and is not ticked until its deadline is over
    handle = leaf.open_handles()[0]
    until(lambda: handle.goal.outcome is not None)
    assert leaf.update() is Status.FAILURE
    assert leaf.outcome is Outcome.SERVER_UNAVAILABLE
    assert leaf.reason.endswith("is in sight, but was not ready, or has requests enough to answer")
    leaf.shutdown()
    host.close_server(name)


def test_an_answer_that_cannot_be_taken_keeps_no_other_goal_from_being_canceled(
    host: Any, name: str, node: Any, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    def broken() -> None:
        raise RuntimeError("of a type from another build")

    journals = [host.open(f"{name}_{which}") for which in ("broken", "sound")]
    leaves = [MoveRobot(which, 9.0, action_name=f"{name}_{which}") for which in ("broken", "sound")]
    with started(together(*leaves), node=node):
        until(lambda: all(state(leaf) == "EXECUTING" for leaf in leaves))
        monkeypatch.setattr(leaves[0]._own.transport, "deliver_arrived", broken)
    assert [journal.ends() for journal in journals] == [["canceled"], ["canceled"]]
    told: list[str] = []  # by the log's own thread
    until(lambda: "not be taken: RuntimeError: of a type" in "".join(told),
          meanwhile=lambda: told.append(capfd.readouterr().err))  # fmt: skip
    for which in ("broken", "sound"):
        host.close_server(f"{name}_{which}")
