"""What a user of the leaf sees, beyond outcomes."""

from collections.abc import Callable
from typing import Any

import py_trees
import pytest
from py_trees.common import Status
from rclpy.executors import SingleThreadedExecutor

from bt_actions import ActionBehaviour, MoveRobot, Outcome, Retry, Timeouts, TreeRunner
from bt_actions.wiring import backend_of
from tests.support.trees import state, together
from tests.support.waiting import until


def test_an_unexpected_result_says_what_was_expected_and_what_came(
    host: Any, name: str, run: Callable[..., Any]
) -> None:
    host.open(name)
    leaf = run(MoveRobot("m", 0.1, action_name=name, expect="result.final_pose > 4.0"))
    assert leaf.outcome is Outcome.UNEXPECTED_RESULT
    assert leaf.reason.startswith("result.final_pose > 4.0 was expected, but the result is: ")
    assert "final_pose: 0.1" in leaf.reason
    host.close_server(name)


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
    node: Any, name: str, settings: dict[str, Any], message: str
) -> None:
    """And not when a goal has moved the robot already."""
    wanted = {"goal": {"distance": 1.0}, **settings}
    leaf = ActionBehaviour("m", "robot_control_interfaces/MoveRobot", name, **wanted)
    with pytest.raises(ValueError, match="m: ") as raised:
        leaf.setup(node=node)
    assert message in str(raised.value)


def test_a_tick_before_setup_says_what_is_wrong(name: str) -> None:
    with pytest.raises(RuntimeError, match="setup"):
        MoveRobot("m", 1.0, action_name=name).tick_once()


def test_setup_without_a_node_says_what_is_wrong(name: str) -> None:
    with pytest.raises(TypeError, match="node"):
        MoveRobot("m", 1.0, action_name=name).setup()


def test_constants_of_a_result_are_known(node: Any, name: str) -> None:
    leaf = MoveRobot("m", 1.0, action_name=name, expect="result.status != result.STATUS_FAULT")
    leaf.setup(node=node)
    leaf.shutdown()


def test_the_first_leaf_that_is_shut_down_closes_for_the_whole_tree(
    node: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_leaves = list[Any]()

    def drain(handles: list[Any], *hurry: Any) -> None:
        if not hurry:  # else it is the run's
            by_leaves.append(handles)

    monkeypatch.setattr(backend_of(node).traffic, "drain", drain)
    leaves = [MoveRobot(f"m{n}", 1.0, action_name=name) for n in range(20)]
    root = py_trees.composites.Sequence("all", memory=True, children=list(leaves))
    with TreeRunner(root, node=node) as runner:
        runner.interrupt()
        runner.run()
    assert len(by_leaves) == 1


def test_a_tick_begins_one_more_attempt_at_most(node: Any, name: str) -> None:
    first = MoveRobot("first", 1.0, action_name=name)
    second = MoveRobot("second", 1.0, action_name=name, busy="fail", retry=1000)
    for leaf in (first, second):
        leaf.setup(node=node)
        leaf.tick_once()
        assert leaf.status is Status.RUNNING
    assert [each.outcome for each in second.history] == [Outcome.SERVER_BUSY] * 2
    second.tick_once()
    assert len(second.history) == 3
    for leaf in (first, second):
        leaf.shutdown()


def test_a_visit_whose_first_tick_breaks_off_is_interrupted_by_the_next(
    host: Any, node: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C in a notebook, which ticks on: no status is set yet, and nobody stops the leaf."""
    journal = host.open(name)
    leaf = MoveRobot("m", 3.0, action_name=name)
    leaf.setup(node=node)
    traffic = backend_of(node).traffic
    until(lambda: leaf._endpoint is not None and leaf._endpoint.transport.ready())
    advance = traffic.advance

    def interrupted(handle: Any, make: Any) -> None:
        advance(handle, make)
        if handle.goal.sent:
            raise KeyboardInterrupt

    monkeypatch.setattr(traffic, "advance", interrupted)

    def first_ticks() -> None:
        while True:
            leaf.tick_once()
            leaf.status = Status.INVALID

    with pytest.raises(KeyboardInterrupt):
        first_ticks()
    monkeypatch.undo()
    leaf.goal = {"distance": 0.1}
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    while leaf.status is not Status.SUCCESS:
        executor.spin_once()
        leaf.tick_once()
    executor.remove_node(node)
    assert journal.ends() == ["canceled", "succeeded"]
    leaf.shutdown()
    host.close_server(name)


def test_a_name_of_the_nodes_own(node: Any) -> None:
    leaf = MoveRobot("m", 1.0, action_name="~/dock")
    leaf.setup(node=node)
    assert leaf.server == f"{node.get_fully_qualified_name()}/dock"
    leaf.shutdown()


def test_a_name_that_ros_refuses_is_refused_in_setup(node: Any) -> None:
    with pytest.raises(ValueError, match="topic name 'a b' is invalid"):
        MoveRobot("m", 1.0, action_name="a b").setup(node=node)


def test_a_loop_that_stands_still_is_not_told_of_another_type(
    host: Any, name: str, node: Any
) -> None:
    host.open(name)
    leaf = MoveRobot("m", 1.0, action_name=name, timeout=Timeouts(server=0.5))
    leaf.setup(node=node)
    until(leaf._endpoint.transport.ready)
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
    with TreeRunner(together(*leaves), node=node) as runner:
        runner.start()
        until(lambda: all(state(leaf) == "EXECUTING" for leaf in leaves))
        monkeypatch.setattr(leaves[0]._endpoint.transport, "pump", broken)
    assert [journal.ends() for journal in journals] == [["canceled"], ["canceled"]]
    told: list[str] = []  # by the log's own thread
    until(lambda: "not be taken: RuntimeError: of a type" in "".join(told),
          meanwhile=lambda: told.append(capfd.readouterr().err))  # fmt: skip
    for which in ("broken", "sound"):
        host.close_server(f"{name}_{which}")
