"""Wherever an expression may stand, a name in it is the tree's own, whoever has one like it.

The places are read off the document's model, so that a new one is tried without being named here.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest
import yaml
from bt_actions_interfaces.action import RunTree
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from bt_actions.document import DocumentError
from bt_actions.document.kinds import KINDS
from bt_actions.document.language.keys import GATES, NODE, NODES, TOP_KEYS
from bt_actions.document.language.scalars import Condition, Duration, Place, Shape, Text
from bt_actions.document.language.shapes import Key, ListOf, ListValue, OneOf, Record, Table, Values
from bt_actions.document.language.values import computed_in
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.source import Source
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner

Load = Callable[..., Behaviour]
Where = tuple[str | int, ...]
PLAIN = {(None, "inputs", "got", "default"), ("python", "arguments")}
"""Where a `$` is read and then refused, as the value is wanted before the tree runs."""


def takes_an_expression(shape: Shape) -> bool:
    for text in ("$order", "$(order)"):
        node = compose(Source("text", text))
        assert node is not None
        if any(True for _ in computed_in(shape.read(node, Source("text", text)))):
            return True
    return False


def places(keys: Mapping[str, Key]) -> Iterator[tuple[Where, Shape]]:
    for key in keys.values():
        yield from places_in(key.shape, (key.name,))


def places_in(shape: Shape, where: Where) -> Iterator[tuple[Where, Shape]]:
    if shape in (NODE, NODES):
        return
    if isinstance(shape, Record | OneOf):
        record = shape if isinstance(shape, Record) else shape.record
        yield from ((where + below, inner) for below, inner in places(record.keys))
    elif isinstance(shape, Table | ListOf):
        yield from places_in(shape.item, (*where, "got" if isinstance(shape, Table) else 0))
    elif takes_an_expression(shape):
        yield where, shape


def all_places() -> Iterator[tuple[str | None, Where, Shape]]:
    """The kind of the node, or None at the top of a document, and the way from there."""
    top = {name: key for name, key in TOP_KEYS.items() if name != "kinds"}  # which read nothing
    yield from ((None, where, shape) for where, shape in places(top))
    for kind in KINDS.values():
        keys = {kind.name: Key(kind.name, kind.value, ""), **kind.keys}
        yield from ((kind.name, where, shape) for where, shape in places(keys))


def written(shape: Shape, example: Any) -> Any:
    """An expression over $order, which is 5, that fits where `example` would."""
    if isinstance(shape, Condition):
        return "$order == 5"
    if isinstance(shape, Values) and isinstance(example, dict):
        return {
            name: "= $order == 5" if isinstance(value, bool) else "= $order / 50.0"
            for name, value in example.items()
        }
    return {
        ListValue: "= [$order]", Duration: "= $order / 50.0", Text: "$(order)", Place: "$order",
    }.get(type(shape), "$order")  # fmt: skip


class Watched(dict[str, Any]):
    """What lies on the blackboard, and which of it was read."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self.read: set[str] = set()

    def __getitem__(self, key: str) -> Any:
        self.read.add(key)
        return super().__getitem__(key)


@pytest.fixture
def blackboard(monkeypatch: pytest.MonkeyPatch) -> Watched:
    """With a stranger's `order` on it."""
    watched = Watched({**Blackboard.storage, "/order": 1000})
    monkeypatch.setattr(Blackboard, "storage", watched)
    return watched


@pytest.fixture
def network() -> VirtualNetwork:
    """With what the examples need, and something on the topic."""
    network = VirtualNetwork()
    answer = RunTree.Result(settled=True, outputs='{"at": 2}')
    ScriptedServer(network, MoveRobot, "move_robot")
    ScriptedServer(network, RunTree, "/r1/run_tree", Script(result=lambda _: answer))
    network.provide(SetBool, "light", lambda _: SetBool.Response(success=True))
    network.publish("door", Bool(data=True), latched=True)
    return network


@pytest.mark.parametrize(
    ("kind", "where", "shape"),
    [
        pytest.param(*place, id=".".join(map(str, (place[0] or "top", *place[1]))))
        for place in all_places()
    ],
)
def test_a_name_in_an_expression_is_the_trees_own(
    load: Load, blackboard: Watched, network: VirtualNetwork,
    kind: str | None, where: Where, shape: Shape,
) -> None:  # fmt: skip
    document: dict[str, Any] = {
        "tree": "t",
        "inputs": {name: {"type": "int32", "default": 5} for name in ("order", "count", "level")},
        "actions": {"got": {"type": "robot_control_interfaces/action/MoveRobot",
                            "server": "move_robot", "goal": {"distance": 0.1}}},
        "root": {"got": "Go"} if kind is None else yaml.safe_load(KINDS[kind].example),
    }  # fmt: skip
    root = document["root"]
    if kind == "wait_for_message":
        root["qos"] = "latched"
    place = document if kind is None else root
    for step in where[:-1]:
        place = place.setdefault(step, {})
    place[where[-1]] = written(shape, place.get(where[-1]))
    if where[0] == "topics":
        place |= {"topic": "got", "type": "std_msgs/msg/Int32", "default": {"data": "$order"}}
        document["root"] = {"check": "$got.data == 5"}
    if where[-1] in GATES:
        place[where[-1]] = "$order == 6"  # and what it leaves out succeeds at the root
    if where[-1] == "when":  # which is asked after an attempt that failed
        place["attempts"], root["expect"] = 2, "false"
    inner = "tree: recover\ninputs: {home: float64}\nroot: {check: $home == 0.1}"
    if (kind, *where) in PLAIN:
        if kind is None:
            document["inputs"]["got"]["type"] = "int32"
        with pytest.raises(DocumentError, match="plain value"):
            load(json.dumps(document), recover=inner)
        return

    status = VirtualRunner(load(json.dumps(document), recover=inner), network).run()
    assert status is (Status.FAILURE if where[-1] == "when" else Status.SUCCESS)
    assert "/order" not in blackboard.read
    assert any(key.startswith("/bt/t/") and key.endswith("/order") for key in blackboard.read)
