"""The life of a managed server, its diagnostics and its parameters, over processes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.srv import CheckTree, ListTrees
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState

from tests.serving.conftest import Serve
from tests.support.processes import Journal
from tests.support.tree_client import TreeClient

LONG = "{distance: 20.0}"
SERVICE_TIMEOUT = 5.0
"""Seconds that Nav2's manager waits for an answer, at its defaults."""
UP = [
    (Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE),
    (Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE),
]
DOWN = [
    (Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE),
    (Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED),
    (Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, State.PRIMARY_STATE_FINALIZED),
]
"""What Nav2's manager asks for, one after the other, and the state that it then wants to see."""
NODE = "bt_actions_serve"
CYCLES = 20


class Manager:
    """Speaks the standard interface of a managed node, as ROS's tools do."""

    def __init__(self, client: TreeClient) -> None:
        self._client = client
        node = client.node
        self._change = node.create_client(ChangeState, f"{NODE}/change_state")
        self._state = node.create_client(GetState, f"{NODE}/get_state")
        self._graph = node.create_client(GetAvailableTransitions, f"{NODE}/get_transition_graph")

    def begin(self, transition: int | str) -> Any:
        self._client.until(self._change.service_is_ready, "the service is there")
        asked = Transition(label=transition) if isinstance(transition, str) else Transition(
            id=transition
        )  # fmt: skip
        return self._change.call_async(ChangeState.Request(transition=asked))

    def change(self, transition: int | str) -> bool:
        future = self.begin(transition)
        self._client.until(future.done, "the change is answered")
        return bool(future.result().success)

    def _ask(self, service: Any, request: Any) -> Any:
        self._client.until(service.service_is_ready, "the service is there")
        future = service.call_async(request)
        self._client.until(future.done, "the call is answered", 5.0)
        return future.result()

    def state(self) -> str:
        return str(self._ask(self._state, GetState.Request()).current_state.label)

    def go(self, steps: list[tuple[int, int]]) -> None:
        """Make transitions as Nav2's manager does with `bond_timeout: 0.0`."""
        for transition, state in steps:
            future = self.begin(transition)
            self._client.until(future.done, "the change is answered", SERVICE_TIMEOUT)
            assert future.result().success
            assert self._ask(self._state, GetState.Request()).current_state.id == state

    def graph(self) -> list[Any]:
        answer = self._ask(self._graph, GetAvailableTransitions.Request())
        return list(answer.available_transitions)


@pytest.fixture
def manager(client: TreeClient) -> Manager:
    return Manager(client)


def test_a_managed_server_goes_through_its_life_again_and_again_and_refuses_what_is_illegal(
    start_managed: Callable[..., Any], client: TreeClient, manager: Manager
) -> None:
    start_managed()
    assert not client.call(ListTrees).trees, "it is unconfigured"
    assert len(manager.graph()) == 25
    for _ in range(CYCLES):
        illegal = (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CLEANUP, "nothing", 99)
        assert not any(manager.change(each) for each in illegal)
        assert manager.change("configure")
        assert not manager.change(Transition.TRANSITION_CONFIGURE)
        assert not client.call(CheckTree, tree="empty").accepted
        assert manager.change(Transition.TRANSITION_ACTIVATE)
        assert not manager.change("cleanup")
        assert client.result(client.send("empty"))[0] == GoalStatus.STATUS_SUCCEEDED
        assert manager.change("deactivate")
        assert manager.change("cleanup")
    assert manager.change("shutdown")
    assert manager.state() == "finalized"
    assert not manager.change("configure")
    assert not client.send("empty").accepted


def test_navs_lifecycle_manager_without_a_bond_brings_it_up_pauses_it_and_takes_it_down(
    start_managed: Callable[..., Any], client: TreeClient, manager: Manager
) -> None:
    start_managed()
    manager.go(UP)
    assert client.result(client.send("empty"))[0] == GoalStatus.STATUS_SUCCEEDED
    manager.go([DOWN[0], UP[1], *DOWN[:2], *UP])  # its pause, resume, reset and startup
    assert client.result(client.send("empty"))[0] == GoalStatus.STATUS_SUCCEEDED
    manager.go(DOWN)


@pytest.mark.chaos
def test_while_a_deactivation_drains_its_state_is_told_and_goals_are_rejected(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, manager: Manager
) -> None:
    journal = serve("1:delay_cancel=2.0")
    serve_trees("--policy", "queue")
    running, waiting = client.send("move", LONG), client.send("empty")
    journal.wait_for("accepted")
    change = manager.begin(Transition.TRANSITION_DEACTIVATE)
    client.until(lambda: manager.state() == "deactivating", "it drains")
    assert not manager.change(Transition.TRANSITION_ACTIVE_SHUTDOWN), "one change at a time"
    assert not client.send("empty").accepted
    client.until(lambda: client.rejections, "the rejection is published")
    assert client.rejections[0].code == "INACTIVE"
    assert client.call(CheckTree, tree="empty").findings[0].code == "INACTIVE"
    assert not change.done()
    for sent in (running, waiting):
        status, result = client.result(sent)
        assert (status, result.error_code, result.settled) == (
            GoalStatus.STATUS_ABORTED, RunTree.Result.DEACTIVATED, True,
        )  # fmt: skip
    client.until(change.done, "it is over")
    assert change.result().success
    assert journal.ends() == ["canceled"]
    assert manager.state() == "inactive"
    assert len(client.call(ListTrees).trees) == 3
    assert manager.change(Transition.TRANSITION_ACTIVATE)
    assert client.result(client.send("empty"))[0] == GoalStatus.STATUS_SUCCEEDED


def test_diagnostics_have_a_status_for_each_tree(
    serve_trees: Serve, client: TreeClient, manager: Manager, folder: Path, space: str
) -> None:
    heard: dict[str, DiagnosticStatus] = {}

    def hear(message: DiagnosticArray) -> None:
        heard.update({each.name: each for each in message.status if each.hardware_id == space})

    def level(tree: str) -> bytes | None:
        status = heard.get(f"{space}/{NODE}: {tree}")
        return None if status is None else status.level

    def comes(tree: str, wanted: bytes) -> None:
        client.until(lambda: level(tree) == wanted, f"{tree} is at {wanted!r}")

    client.node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    (folder / "empty.yaml").write_text("tree: empty\nroot: {failure: Never}\n")
    serve_trees()
    comes("move", DiagnosticStatus.OK)
    comes("empty", DiagnosticStatus.OK)
    comes("broken", DiagnosticStatus.ERROR)
    client.result(client.send("empty"))
    comes("empty", DiagnosticStatus.WARN)
    (folder / "empty.yaml").write_text("tree: empty\nroot: {success: }\n")
    client.result(client.send("empty"))
    comes("empty", DiagnosticStatus.OK)
    assert manager.change(Transition.TRANSITION_DEACTIVATE)
    comes("move", DiagnosticStatus.ERROR)
    assert manager.state() == "inactive"
