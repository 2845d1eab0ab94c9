"""What a cleanup awaits of what dead processes sent; with killed orchestrators: tests/scenarios."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bt_actions.goals.ids import Author
from bt_actions.goals.policy import End
from bt_actions.recovery import sweep as module
from bt_actions.recovery.ledger import Sent
from bt_actions.recovery.roll_call import LeftBehind, RollCall
from bt_actions.recovery.sweep import Cleanup, Swept
from bt_actions.ros.onlooker import CannotStart
from tests.support.processes import Journal, Process

SEND = """
import sys, rclpy
from rclpy.action import ActionClient
from robot_control_interfaces.action import MoveRobot
from unique_identifier_msgs.msg import UUID
from bt_actions.goals.ids import new_goal_id
from bt_actions.recovery.ledger import Ledger
from bt_actions.ros.graph import servers
from bt_actions.traffic.state import Entry
action, domain, distance, known, lost = sys.argv[1:]
domain, distance, lost = int(domain), float(distance), lost == "1"
known = [known.encode()] if known else []
rclpy.init()
node, goal_id = rclpy.create_node("sender"), new_goal_id()
client = ActionClient(node, MoveRobot, action)
if distance:
    client.wait_for_server()
    known = servers(node, action)
Ledger(print).enter(goal_id, Entry(action, domain, frozenset(known), lost=lost))
if distance:
    goal = MoveRobot.Goal(distance=distance)
    client.send_goal_async(goal, goal_uuid=UUID(uuid=list(goal_id)))
print(goal_id.hex(), flush=True)
rclpy.spin(node)
"""
"""A program that has one goal on record, whatever is answered; it sends it if it has a distance."""

Leave = Callable[..., str]


@pytest.fixture(autouse=True)
def records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the records of a test's programs are."""
    path = tmp_path / "records"
    monkeypatch.setenv("BT_ACTIONS_LEDGER", str(path))
    return path


@pytest.fixture
def leave(start_program: Callable[..., Process], name: str, domain: int) -> Leave:
    """Have a program send a goal, or only say so, and kill it; return the goal's id."""

    def leave_behind(
        distance: float,
        *,
        servers: str = "",
        lost: bool = False,
        journal: Journal | None = None,
        elsewhere: int = 0,
    ) -> str:
        arguments = [name, str(domain + elsewhere), str(distance), servers, str(int(lost))]
        sender = start_program("-c", SEND, *arguments)
        goal = sender.line()
        if journal is not None:
            journal.wait_for("received", within=20.0)
        sender.send(signal.SIGKILL)
        sender.popen.wait()
        return goal

    return leave_behind


def sweep(**more: Any) -> tuple[Swept, list[str]]:
    """Clean up; return what came of it, and what was found."""
    found: list[str] = []

    def note(left: LeftBehind) -> None:
        found.append(f"{'awaited' if left.awaited else 'shown'} {left.goal_id.hex()}")

    return Cleanup(look=1.0, patience=5.0, found=note, **more).run(), found


def test_what_is_on_record_and_in_a_status_is_one_goal(
    serve: Callable[..., Journal], leave: Leave, records: Path
) -> None:
    journal = serve()
    goal = leave(90.0, journal=journal)
    swept, found = sweep()
    assert [(left.goal_id.hex(), left.end) for left in swept.left] == [(goal, End.CANCELED)]
    assert found == [f"awaited {goal}", f"shown {goal}"]
    assert list(records.iterdir()) == []


@pytest.mark.parametrize(
    ("given", "on_record", "takes"),
    [(0.0, "0", 2.0), pytest.param(1.0, "3.0", 3.0, marks=pytest.mark.chaos)],
)
def test_how_long_one_has_to_be_denied(
    given: float,
    on_record: str,
    takes: float,
    serve: Callable[..., Journal],
    leave: Leave,
    records: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The server has never got it."""
    monkeypatch.setattr(module, "DENIED_FOR_GOOD", 2.0)
    serve()
    leave(0.0)
    [path] = records.iterdir()
    told = '"accept": 0.0'
    path.write_text(path.read_text().replace(told, f'"accept": {on_record}'.ljust(len(told))))
    swept, _ = sweep(accept=given)
    assert [left.nothing_left for left in swept.left] == [f"denied for {takes:g} s"]
    assert list(records.iterdir()) == []


@pytest.mark.parametrize("how", ["stopped", "no participant"])
def test_one_that_was_not_looked_for_to_the_end_stays_on_record(
    how: str, leave: Leave, records: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    leave(0.0)
    stopped: list[int] = []
    if how == "stopped":
        sweep(stopped=lambda: len(stopped.append(1) or stopped) > 10)
    else:

        def no_more(*_: Any, **__: Any) -> None:
            raise CannotStart("no descriptors")

        monkeypatch.setattr(Cleanup, "_goes_through", lambda *_, **__: False)
        begin = Cleanup._begin

        def once(self: Any, *given: Any) -> None:
            begin(self, *given)
            monkeypatch.setattr(module, "onlooker", no_more)

        monkeypatch.setattr(Cleanup, "_begin", once)
        sweep()
    assert len(list(records.iterdir())) == 1


def test_records_that_cannot_be_read_are_told(
    serve: Callable[..., Journal], leave: Leave, records: Path
) -> None:
    serve()
    leave(0.0)
    records.chmod(0o777)
    swept, found = sweep()
    assert found == []
    assert isinstance(swept.trouble, PermissionError)


def test_one_whose_server_comes_in_sight_after_all_is_awaited_again() -> None:
    left = LeftBehind(RollCall("/move"), b"goal", 1, awaited=True)
    left.judge(known=False, gone=True)
    assert left.awaited, "it may come in sight yet"
    left.judge(known=True, gone=True)
    assert (left.is_over, left.nothing_left) == (True, "its server is gone")
    left.judge(known=False, gone=False)
    assert (left.awaited, left.is_over) == (True, False)


@pytest.mark.parametrize("servers", [[b"a"], [b"a", b"b"]])
def test_what_one_of_two_servers_shows_stays_on_record(
    servers: list[bytes], tmp_path: Path
) -> None:
    author = Author(here=True, pid=2**22 + 1, started=b"ab")
    path = tmp_path / "x"
    sent = Sent("/move", 0, frozenset(servers), goal_id=b"goal", author=author, path=path, at=0)
    left = LeftBehind(RollCall("/move"), b"goal", 1, shown=End.CANCELED)
    over = Cleanup()
    over._sent[b"goal"], over._left[b"goal"] = sent, left
    path.touch()
    over._keep_record()
    assert path.exists() is (len(servers) > 1)
    left.nothing_left = "denied for 30 s"
    over._keep_record()
    assert not path.exists()
