"""What servers do wrong on the virtual network is told as on a real one."""

from dataclasses import replace

import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import End, MoveRobot, Outcome, Timeouts
from bt_actions.events import GoalChanged
from bt_actions.simulation import Script, ScriptedServer
from bt_actions.testing import VirtualNetwork, VirtualRunner

TIMEOUTS = Timeouts(server=2.0, accept=1.0, result=5.0, feedback=2.0, cancel=2.0)

FAULTS = {
    "reject": (Outcome.REJECTED, End.NEVER_STARTED),
    "abort": (Outcome.ABORTED, End.ABORTED),
    "stall": (Outcome.STALLED, End.CANCELED),
    "slow=9": (Outcome.RESULT_TIMEOUT, End.CANCELED),
    "no_feedback": (Outcome.STALLED, End.CANCELED),
    "drop_accept": (Outcome.SUCCEEDED, End.SUCCEEDED),
    "delay_accept=0.9": (Outcome.SUCCEEDED, End.SUCCEEDED),
    "drop_result=1": (Outcome.SUCCEEDED, End.SUCCEEDED),
    "die": (Outcome.SERVER_LOST, End.SERVER_GONE),
    "restart=1": (Outcome.SERVER_LOST, End.SERVER_GONE),
}


@pytest.mark.parametrize(("fault", "told"), FAULTS.items(), ids=FAULTS)
def test_a_fault_has_its_outcome_and_its_end(fault: str, told: tuple[Outcome, End]) -> None:
    network = VirtualNetwork()
    server = ScriptedServer(
        network, Move, "move_robot", Script(duration=3.0), faults=[f"move_robot:1:{fault}"]
    )
    runner = VirtualRunner(MoveRobot("move", 1.0, timeout=TIMEOUTS), network)
    runner.run()
    last = [event for event in runner.events if isinstance(event, GoalChanged)][-1]
    assert (last.outcome, last.end) == told
    assert (runner.unaccounted, server.live_goals) == ([], [])


@pytest.mark.parametrize("fault", ["reject_cancel", "drop_cancel", "drop_goal"])
def test_a_goal_of_which_nobody_knows_the_end_is_reported(fault: str) -> None:
    network = VirtualNetwork()
    ScriptedServer(
        network, Move, "move_robot", Script(duration=60.0), faults=[f"move_robot:1:{fault}"]
    )
    runner = VirtualRunner(MoveRobot("move", 1.0, timeout=TIMEOUTS), network)
    assert runner.run() is Status.FAILURE
    [goal] = runner.unaccounted
    assert (goal.name, goal.server, goal.fields) == ("move", "/move_robot", "{distance: 1.0}")
    [told] = [line for line in network.log.lines if "not accounted for" in str(line)]
    assert f"move on /move_robot, goal {goal.goal_id}" in str(told)
    assert "{distance: 1.0}" in str(told)
    assert "`bt-actions cleanup /move_robot` cancels it" in str(told)
    assert "<Goal" not in str(told)


def test_two_servers_under_one_name_are_not_spoken_to() -> None:
    network = VirtualNetwork()
    servers = [ScriptedServer(network, Move, "move_robot") for _ in range(2)]
    runner = VirtualRunner(MoveRobot("move", 1.0), network)
    runner.run()
    assert runner.outcomes == [("move", Outcome.SERVER_AMBIGUOUS)]
    assert [server.live_goals for server in servers] == [[], []]


def test_where_nobody_serves_it_says_who_does() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robots")
    runner = VirtualRunner(MoveRobot("move", 1.0, timeout=replace(TIMEOUTS, server=0.5)), network)
    assert runner.run() is Status.FAILURE
    assert runner.outcomes == [("move", Outcome.SERVER_UNAVAILABLE)]
    assert "move_robots" in runner.tree.root.feedback_message
