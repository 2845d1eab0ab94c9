"""Runs that somebody else pauses, resumes and halts: the service, and `bt-actions control`."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.srv import ControlTree, ListTrees
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from unique_identifier_msgs.msg import UUID

from bt_actions.cli import main
from tests.serving.conftest import MAIN, Serve
from tests.support.processes import Journal, Process
from tests.support.tree_client import Sent, TreeClient
from tests.support.waiting import until

R = RunTree.Result
LONG = "{distance: 60.0}"
PAUSE, RESUME, HALT = (
    ControlTree.Request.PAUSE,
    ControlTree.Request.RESUME,
    ControlTree.Request.HALT,
)


def id_of(sent: Sent) -> str:
    return bytes(sent.handle.goal_id.uuid).hex()


def test_a_run_is_paused_resumed_and_halted_by_its_goals_id(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve()
    serve_trees()
    sent = client.send("move", "{distance: 0.5}")
    ours = sent.handle.goal_id
    journal.wait_for("accepted")

    def control(command: int, **more: object) -> ControlTree.Response:
        return client.call(ControlTree, command=command, **more)

    assert control(ControlTree.Request.PAUSE, goal_id=ours, requested_by="test").accepted
    journal.wait_for("succeeded")
    assert not sent.result_future.done(), "its next leaf is not ticked"
    assert control(ControlTree.Request.RESUME, goal_id=ours).accepted
    assert client.result(sent)[0] == GoalStatus.STATUS_SUCCEEDED

    sent = client.send("move", LONG)
    assert not control(ControlTree.Request.HALT).accepted, "of nobody"
    assert not control(0, goal_id=sent.handle.goal_id).accepted, "nothing"
    assert control(ControlTree.Request.HALT, goal_id=sent.handle.goal_id).accepted
    status, result = client.result(sent)
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, R.HALTED)


def test_a_paused_run_is_told_of_as_one_in_feedback_list_diagnostics_and_log(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, space: str
) -> None:
    journal = serve()
    server = serve_trees()
    told: dict[bytes, str] = {}
    doing = set[str]()

    def hear(message: DiagnosticArray) -> None:
        mine = [each for each in message.status if each.name.endswith(": move")]
        doing.update(each.value for one in mine for each in one.values if each.key == "doing")
        told.update({each.level: each.message for each in mine if each.hardware_id == space})

    client.node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    sent = client.send("move", LONG)
    ours = sent.handle.goal_id
    journal.wait_for("accepted")
    client.until(lambda: sent.feedback, "it runs")
    assert not any(each.paused for each in sent.feedback)
    runs = re.compile(rf".+: executing on {space}/move for \d+.*")
    client.until(lambda: any(map(runs.match, doing)), "the diagnostics say what runs")
    assert client.call(ControlTree, goal_id=ours, command=PAUSE).accepted
    client.until(lambda: sent.feedback[-1].paused, "it is in the feedback")
    client.until(lambda: told.get(DiagnosticStatus.WARN) == "paused", "it is in the diagnostics")
    move = next(each for each in client.call(ListTrees).trees if each.name == "move")
    assert [list(each.uuid) for each in move.paused] == [list(ours.uuid)]
    assert client.call(
        ControlTree, goal_id=ours, command=RESUME, requested_by="the shift\nleader"
    ).accepted
    client.until(lambda: not sent.feedback[-1].paused, "it goes on")
    assert not any(each.paused for each in client.call(ListTrees).trees)
    said = f"{space}/bt_actions_serve: move {id_of(sent)}"
    until(lambda: any(f"{said} pause asked for by a client" in line for line in server.errors))
    until(
        lambda: any(
            f"{said} resume asked for by the shift leader" in each for each in server.errors
        )
    )
    client.cancel(sent)
    client.result(sent)


def test_a_request_that_means_nothing_is_answered_with_what_there_is(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    serve()
    serve_trees()

    def told(**request: object) -> str:
        answer = client.call(ControlTree, **request)
        assert not answer.accepted
        return str(answer.message)

    assert told(command=HALT) == "no goal id is given; nothing runs here"
    sent = client.send("move", LONG)
    ours = id_of(sent)
    assert told() == "0 is no command; pause (1), resume (2), halt (3) are"
    assert told(goal_id=sent.handle.goal_id, command=9).startswith("9 is no command; pause (1)")
    assert told(command=PAUSE) == f"no goal id is given; there is {ours} (move)"
    other = UUID(uuid=[1] * 16)
    assert (
        told(goal_id=other, command=PAUSE)
        == f"no goal {'01' * 16} runs here; there is {ours} (move)"
    )
    client.cancel(sent)
    client.result(sent)


Control = Callable[..., tuple[int, str]]


@pytest.fixture
def control(start_program: Callable[..., Process], space: str) -> Control:
    """Run `bt-actions control`; its exit code, and its last line."""

    def run(*words: str, server: str = f"{space}/run_tree") -> tuple[int, str]:
        process = start_program("-c", MAIN, "control", server, *words, short_lease=True)
        code = process.wait(30.0)
        return code, (process.lines or process.errors)[-1]

    return run


def test_control_takes_the_one_run_there_is_or_the_beginning_of_its_id(
    serve: Callable[..., Journal],
    serve_trees: Serve,
    client: TreeClient,
    control: Control,
    space: str,
) -> None:
    serve()
    serve_trees("--policy", "parallel")
    assert control("pause") == (1, f"bt-actions control: no tree runs at {space}/run_tree")
    first = client.send("move", LONG)
    assert control("pause") == (0, f"paused: move {id_of(first)}")
    client.until(lambda: first.feedback and first.feedback[-1].paused, "it is paused")
    assert control("resume", id_of(first)) == (0, f"resumed: move {id_of(first)}")
    second = client.send("move", LONG)
    code, text = control("halt")
    assert code == 2
    assert all(f"{id_of(each)} (move)" in text for each in (first, second))
    wrong = next(
        digit for digit in "0123456789abcdef" if digit not in (id_of(first)[0], id_of(second)[0])
    )
    code, text = control("halt", wrong)
    assert (code, "no run" in text, id_of(first) in text) == (2, True, True)
    beginning = id_of(second)[:9].upper()
    assert control("halt", f"{beginning[:8]}-{beginning[8:]}")[0] == 0
    assert client.told(second) == (GoalStatus.STATUS_ABORTED, R.HALTED, True)
    assert not first.result_future.done()
    client.cancel(first)
    client.result(first)


def test_a_run_that_waits_for_its_turn_is_told_of_as_one_and_is_not_meant(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, control: Control
) -> None:
    serve()
    serve_trees("--policy", "queue")
    first, second = client.send("move", LONG), client.send("move", LONG)
    client.until(lambda: second.feedback and second.feedback[-1].waiting, "it waits")
    assert not any(each.waiting for each in first.feedback)
    move = next(each for each in client.call(ListTrees).trees if each.name == "move")
    assert [list(each.uuid) for each in move.waiting] == [list(second.handle.goal_id.uuid)]
    assert control("halt") == (0, f"being halted: move {id_of(first)}")
    client.until(lambda: not second.feedback[-1].waiting, "its turn has come")
    client.cancel(second)
    client.result(second)


def test_call_shows_that_its_run_is_paused(
    serve: Callable[..., Journal],
    serve_trees: Serve,
    start_program: Callable[..., Process],
    control: Control,
    space: str,
) -> None:
    journal = serve()
    serve_trees()
    words = ["move", "--set", "distance=20.0", "--namespace", space]
    call = start_program("-c", MAIN, "call", *words, short_lease=True)
    journal.wait_for("accepted", within=20.0)
    control("pause", f"--namespace={space}", server="run_tree")
    until(lambda: any("paused: Move / Go" in line for line in call.lines))
    assert control("halt")[0] == 0
    assert call.wait(30.0) == 1
    assert "it was halted" in "\n".join(call.lines)


def test_control_says_where_there_is_no_server(control: Control, space: str) -> None:
    code, text = control("pause")
    assert code == 1
    assert f"no server of trees offers {space}/run_tree" in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["/run_tree", "pause", "xyz"], "'xyz' is no goal's id: 32 hexadecimal digits"),
        (["/run_tree", "pause", "0" * 33], "is no goal's id"),
    ],
)
def test_a_wrong_word_of_control_is_told(
    words: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["control", *words]) == 2
    assert message in capfd.readouterr().err
