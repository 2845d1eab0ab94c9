"""What cleanup takes for known; scenarios with killed orchestrators are in tests/scenarios."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Collection
from typing import Any

import pytest

from bt_actions import MoveRobot
from bt_actions.goals.policy import End
from bt_actions.recovery import roll_call
from bt_actions.recovery import sweep as module
from bt_actions.recovery.roll_call import LeftBehind
from bt_actions.recovery.sweep import Cleanup, Swept
from bt_actions.ros import onlooker as sight
from bt_actions.ros.naming import server_names
from bt_actions.ros.onlooker import CannotStart
from tests.support.processes import Host, HostFactory, Journal, Process

SEND = (
    "import sys, rclpy;"
    "from rclpy.action import ActionClient;"
    "from robot_control_interfaces.action import MoveRobot;"
    "from unique_identifier_msgs.msg import UUID;"
    "from bt_actions.utilities.ids import new_id;"
    "rclpy.init(); node = rclpy.create_node('sender');"
    "client = ActionClient(node, MoveRobot, sys.argv[1]); client.wait_for_server();"
    "goal_id = UUID(uuid=list(new_id()));"
    "client.send_goal_async(MoveRobot.Goal(distance=90.0), goal_uuid=goal_id);"
    "rclpy.spin(node)"
)
"""A program that sends one goal with an id of ours, and waits."""


@pytest.fixture
def left(start_program: Callable[..., Process], serve: Callable[..., Journal], name: str) -> str:
    """Leave a goal of a killed process on `name`; return its id."""
    journal = serve()
    sender = start_program("-c", SEND, name)
    goal = journal.wait_for("accepted", within=20.0).goal
    sender.send(signal.SIGKILL)
    sender.popen.wait()
    return goal


def sweep(wanted: Collection[str], **more: Any) -> Swept:
    """Clean up; return what came of it."""
    return Cleanup(**{"look": 1.0, "patience": 1.0, "wanted": wanted, **more}).run()


@pytest.mark.parametrize("wrong", [{"look": -1.0}, {"patience": math.nan}, {"accept": -1.0}])
def test_seconds_are_none_or_more(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="seconds are 0 or more"):
        sweep([], **wrong)


def when_sighted(
    name: str, monkeypatch: pytest.MonkeyPatch, call: Callable[[], object], servers: int = 1
) -> None:
    """Call this at each look that shows so many servers of the action."""
    real = sight.servers

    def seen(node: Any, action: str) -> frozenset[bytes]:
        shown = real(node, action)
        if action == name and len(shown) == servers:
            call()
        return shown

    monkeypatch.setattr(sight, "servers", seen)


def test_of_two_servers_each_has_to_answer(
    new_host: HostFactory, name: str, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One is stopped when both are in sight, and before it has told what it runs."""
    monkeypatch.setattr(module, "LOOK_LONGEST", 6.0)
    hosts = [new_host(short_lease=False) for _ in range(2)]
    for host in hosts:
        host.open(name)
    when_sighted(name, monkeypatch, lambda: hosts[0].send(signal.SIGSTOP), servers=2)
    swept = sweep([name])
    hosts[0].send(signal.SIGCONT)
    assert swept.missing == [name]
    assert name not in swept.known


def test_the_end_of_a_goal_is_nobodys_where_a_second_server_was_in_sight(
    left: str, name: str, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It went away meanwhile, frozen perhaps, and may run the goal."""
    real, found = sight.servers, list[LeftBehind]()

    def one_goes(node: Any, action: str) -> frozenset[bytes]:
        shown = real(node, action)
        return shown | {b"another"} if action == name and shown and not found else shown

    monkeypatch.setattr(sight, "servers", one_goes)
    swept = sweep(
        [name],
        found=found.append,
        stopped=lambda: any(goal.shown is End.CANCELED for goal in found),
    )
    assert [(goal.goal_id.hex(), len(goal.call.servers), goal.end) for goal in swept.left] == [
        (left, 2, End.UNKNOWN)
    ]
    assert name in swept.unknown


def test_it_ends_when_it_is_told_to_and_tells_what_it_has_found(
    left: str, name: str, domain: int
) -> None:
    found: list[LeftBehind] = []
    swept = Cleanup(look=60.0, found=found.append, stopped=lambda: bool(found)).run()
    assert [goal.goal_id.hex() for goal in swept.left] == [left]


def test_a_server_that_tells_its_goals_is_not_waited_for_and_no_other_is_asked(
    left: str, name: str, host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(roll_call, "SETTLE", math.inf)
    other = host.open(f"{name}/other")
    swept = sweep([name], look=5.0)
    host.close_server(f"{name}/other")
    assert (swept.known, swept.missing, swept.unknown) == ([name], [], {})
    assert [(goal.goal_id.hex(), goal.end) for goal in swept.left] == [(left, End.CANCELED)]
    assert other.events() == []


def test_a_domain_that_is_none_is_refused(
    domain: int, no_leaks: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "none")
    with pytest.raises(CannotStart):
        Cleanup().run()


@pytest.mark.usefixtures("domain", "no_leaks")
def test_a_server_is_the_one_that_a_node_with_the_same_words_for_ros_would_ask(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What `ros2 launch` gives a node as its namespace, and as rules, is in force."""
    rules = [
        f"{one}/_action/send_goal:={other}/_action/send_goal"
        for one, other in (("left", "/r1/right"), ("right", "/r1/left"), ("base", "/base"))
    ]
    rules += ["__ns:=/r1", "move:=/no/effect", "other:far/_action/send_goal:=/no/effect"]
    words = [word for rule in rules for word in ("-r", rule)]
    monkeypatch.setattr("sys.argv", ["", "--ros-args", *words])
    asked = {name: server_names([name], "deliver") for name in
             ("left", "/r1/right", "base", "move", "far", "/r2/move")}  # fmt: skip
    assert asked == {
        "left": ["/r1/right"], "/r1/right": ["/r1/left"], "base": ["/base"],
        "move": ["/r1/move"], "far": ["/r1/far"], "/r2/move": ["/r2/move"],
    }  # fmt: skip


def test_no_rule_leads_a_cleanup_away_from_the_server_that_it_is_given(
    left: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two names that a run has exchanged, say."""
    rules = [f"{name}/_action/{part}:={name}/nobody/_action/{part}"
             for part in ("cancel_goal", "status", "send_goal")]  # fmt: skip
    words = [word for rule in rules for word in ("-r", rule)]
    monkeypatch.setattr("sys.argv", ["", "--ros-args", *words])
    assert [(each.goal_id.hex(), each.end) for each in sweep([name]).left] == [(left, End.CANCELED)]


def test_cleanup_looks_at_the_servers_whose_names_it_is_given(
    domain: int, no_leaks: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LOOK_LONGEST", 0.2)
    told = list[list[str]]()
    swept = sweep({"/r1/move", "/r2/move"}, look=0.1, patience=0.1, waits=told.append)
    assert told == [swept.missing] == [["/r1/move", "/r2/move"]]
    assert swept.domain == domain, "the one in force"


def test_cleanup_does_not_take_silence_for_nothing(
    new_host: HostFactory, name: str, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LOOK_LONGEST", 6.0)
    host = new_host(short_lease=False)
    host.open(name)
    told = list[list[str]]()
    when_sighted(name, monkeypatch, lambda: host.send(signal.SIGSTOP))

    def look(wanted: list[str] | None) -> Swept:
        swept = Cleanup(look=1.0, waits=told.append, wanted=wanted).run()
        host.send(signal.SIGCONT)
        return swept

    swept = look(wanted=[])
    assert swept.missing == told == [], "who wants no action is in no server's way"
    assert name not in swept.known
    assert name not in swept.unknown, "it was not asked"
    assert name in look(wanted=None).missing
    assert [name in actions for actions in told] == [True]


def test_cleanup_sees_no_server_where_there_is_a_client_only(
    name: str, node: Any, domain: int
) -> None:
    leaf = MoveRobot("client", 1.0, action_name=name)
    leaf.setup(node=node)
    swept = Cleanup(look=1.0).run()
    assert swept.left == []
    assert name not in [*swept.known, *swept.unknown]
    leaf.shutdown()
