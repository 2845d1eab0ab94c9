"""The kinds of nodes: which keys each has, of which form, and what it is for.

What a kind does when it is built stands in `building/` under the same name; a test compares the
two.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bt_actions.document.language.keys import (
    ACTION_NAME,
    ACTION_SERVER,
    ACTION_TYPE,
    DOING,
    MESSAGE_TYPE,
    NAMESPACE,
    NODE,
    NODES,
    POLICIES,
    QOS,
    RESULT,
    SERVICE_RETRY,
    TIMEOUT,
    TOPIC_NAME,
    keyed,
)  # fmt: skip
from bt_actions.document.language.ros_names import RosName
from bt_actions.document.language.scalars import (
    Choice,
    Condition,
    Duration,
    Flag,
    Name,
    NodeName,
    Place,
    Quantity,
    Shape,
    Text,
    TypeName,
    Whole,
)
from bt_actions.document.language.shapes import (
    AnyValue,
    Key,
    ListValue,
    OneOf,
    Record,
    Table,
    Values,
)  # fmt: skip

if TYPE_CHECKING:
    from bt_actions.messages.interfaces import Kind as InterfaceKind

_MESSAGE = frozenset({"message"})
_RUN = frozenset({"result", "outputs"})
_NAME = Key("name", NodeName(), "The node's name, where the kind's value does not say enough.")


class Group(StrEnum):
    """What py_trees calls the place of a node."""

    COMPOSITE = "composite"
    DECORATOR = "decorator"
    LEAF = "leaf"


@dataclass(frozen=True, slots=True)
class Interface:
    """What a kind talks over: `name` is the key that names the server or the topic.

    `fields` is the key for the fields of what is sent, which are those of the part `sent` of the
    interface; `root` is what expressions call the part `received`.
    """

    kind: InterfaceKind
    name: str
    fields: str = ""
    sent: str = ""
    root: str = ""
    received: str = ""

    def part(self, cls: Any, name: str) -> Any:
        """The part of an interface's class; a message is its own."""
        return getattr(cls, name) if name else cls


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of node. `value` is the form of what stands behind the kind's own key.

    `reads` is the key whose value is computed before anything is done; the node fails without it.
    """

    name: str
    group: Group
    value: Shape
    doc: str
    keys: Mapping[str, Key]
    example: str
    reads: str
    interface: Interface | None = None

    @property
    def named_by_value(self) -> bool:
        """Whether the kind's value is the node's name."""
        return isinstance(self.value, NodeName)


SERVICE_TIMEOUT = Record(
    "a duration or a mapping of deadlines",
    keyed(
        Key("server", Duration(or_none=True), "For the service to be there.", default="5 s"),
        Key("response", Duration(or_none=True), "For the answer.", default="5 s"),
    ),
    short="response",
)
_POLICY = OneOf(
    Choice(("all", "one")),
    Record(
        "{at_least: N}",
        keyed(Key("at_least", Whole(1), "So many must succeed.", required=True, example="2")),
    ),
)
_LIST = ListValue()
_CHILDREN_KEY = Key("children", NODES, "The nodes it holds.", required=True,
                    example="[{success: First}, {success: Second}]")  # fmt: skip
_CHILD_KEY = Key("child", NODE, "The node it holds.", required=True, example="{success: Done}")
_MEMORY = Key(
    "memory",
    Flag(),
    "Whether a child that has finished is left alone; false makes the node reactive.",
    default="true",
)


def _composite(name: str, doc: str, example: str, *keys: Key) -> Kind:
    return Kind(name, Group.COMPOSITE, NodeName(), doc, keyed(_CHILDREN_KEY, *keys), example, name)


def _decorator(name: str, doc: str, example: str, *keys: Key) -> Kind:
    reads = keys[0].name if keys else name
    return Kind(name, Group.DECORATOR, NodeName(), doc, keyed(_CHILD_KEY, *keys), example, reads)


def _leaf(
    name: str,
    value: Shape,
    doc: str,
    example: str,
    *keys: Key,
    reads: str | None = None,
    interface: Interface | None = None,
) -> Kind:
    all_keys = keyed(*keys, *(() if isinstance(value, NodeName) else (_NAME,)))
    if reads is None:
        reads = interface.fields if interface is not None else name
    return Kind(name, Group.LEAF, value, doc, all_keys, example, reads, interface)


def _all() -> Iterable[Kind]:
    yield _composite(
        "sequence",
        "Ticks its children in order until one fails; succeeds when all have.",
        "sequence: Fetch\nchildren:\n  - success: Go\n  - success: Grasp",
        _MEMORY,
    )
    yield _composite(
        "fallback",
        "Ticks its children in order until one succeeds; fails when all have.",
        "fallback: Try both ways\nchildren:\n  - failure: Left\n  - success: Right",
        _MEMORY,
    )
    yield _composite(
        "parallel",
        "Ticks its children beside each other. A child that has finished is not started again; "
        "none is begun once the node has succeeded or failed, which is decided after each.",
        "parallel: Look and listen\nchildren:\n  - success: Look\n  - success: Listen",
        Key("policy", _POLICY, "How many must succeed; the rest is then stopped.", default="all"),
    )
    yield _decorator(
        "retry",
        "Ticks its child again when it has failed.",
        "retry: Until it holds\nattempts: 3\nbackoff: 500 ms\nchild:\n  success: Grasp",
        Key("attempts", Whole(1, values=True), "All tries.", default="without limit", example="3"),
        Key("backoff", Duration(zero=True), "The pause before the second try.", default="0 s"),
        Key("factor", Quantity(1.0), "Each pause is this much longer.", default="2"),
        Key("max_backoff", Duration(zero=True), "The longest pause.", default="60 s"),
    )
    yield _decorator(
        "repeat",
        "Ticks its child again when it has succeeded; fails as soon as it fails.",
        "repeat: Three rounds\ntimes: 3\nchild:\n  success: Patrol",
        Key("times", Whole(0, values=True), "All rounds.", default="for ever", example="3"),
    )
    yield _decorator(
        "timeout",
        "Stops its child after some time, and fails when what it stopped has ended, or did not end "
        "within its own 'cancel'.",
        "timeout: Ten seconds at most\nafter: 10 s\nchild:\n  success: Search",
        Key("after", Duration(values=True), "How long the child may take.", required=True,
            example="10 s"),
    )  # fmt: skip
    yield _decorator(
        "invert", "Succeeds when its child fails, and fails when it succeeds.",
        "invert: Nobody there\nchild:\n  failure: Somebody",
    )  # fmt: skip
    yield _decorator(
        "force_success", "Succeeds when its child has finished, however.",
        "force_success: If possible\nchild:\n  failure: Wave",
    )  # fmt: skip
    yield _decorator(
        "force_failure", "Fails when its child has finished, however.",
        "force_failure: Give up\nchild:\n  success: Go home",
    )  # fmt: skip
    yield _decorator(
        "run_once", "Runs its child to its end once, and keeps to that end ever after.",
        "run_once: Calibrate first\nchild:\n  success: Calibrate",
    )  # fmt: skip
    yield _decorator(
        "for_each",
        "Ticks its child once for each item of a list.",
        "for_each: Every station\nin: [1.0, 2.0]\nas: station\nchild:\n"
        "  check: $station > 0",
        Key("in", _LIST, "The list.", required=True, example="[1.0, 2.0]"),
        Key("as", Name(), "The variable that holds the item.", default="item"),
        Key("index", Name(), "A variable that counts the items, from 0."),
        Key("on_failure", Choice(("stop", "continue")),
            "Whether to go on when an item fails; the node then succeeds if any item did.",
            default="stop"),
    )  # fmt: skip
    yield Kind(
        "while",
        Group.DECORATOR,
        Condition(),
        "Ticks its child as long as the expression is true, asked before each tick; stops it and "
        "fails when it is not.",
        keyed(_CHILD_KEY, _NAME),
        "while: $level > 0.2\nchild:\n  success: Work",
        "while",
    )
    yield _leaf(
        "action",
        NodeName(),
        "Sends a goal to an action; the same as a name under `actions`, with type and server here.",
        "action: To the part\ntype: robot_control_interfaces/action/MoveRobot\n"
        "server: move_robot\ngoal: {distance: 2.0}\ntimeout: 30 s",
        ACTION_TYPE,
        ACTION_NAME,
        *DOING,
        interface=Interface("action", "server", "goal", "Goal", "result", "Result"),
    )
    yield _leaf(
        "run_tree",
        NodeName(),
        "Has a tree run by a server of trees (`bt-actions serve`), and takes over how it ends: "
        "where the end of a goal of that run is not known, it is not known here either.",
        "run_tree: Fetch the part\ntree: fetch\nserver: /r1/run_tree\ninputs: {pick_at: 2.0}\n"
        "save: {at: outputs.at}",
        Key("tree", Text(values=True), "The tree's name at that server.", required=True,
            example="fetch"),
        Key("server", ACTION_SERVER, "The server's action.", default="run_tree"),
        Key("inputs", Values(), "Values for the tree's inputs."),
        Key("timeout", TIMEOUT, "As for an action, but `cancel` is 15 s where nothing is said: "
            "the run sees its own goals to their ends first."),
        *POLICIES[1:],
        Key("expect", Condition(_RUN), "What must hold of `result`, or of `outputs`."),
        Key("save", Table(Place(_RUN)), "Names to keep parts of the outputs under."),
        *DOING[-2:],
        reads="inputs",
        interface=Interface("action", "server", root="result", received="Result"),
    )  # fmt: skip
    yield _leaf(
        "service",
        NodeName(),
        "Calls a service.",
        "service: Switch the light on\ntype: std_srvs/srv/SetBool\nserver: light\n"
        "request: {data: true}\nexpect: result.success",
        Key("type", TypeName("srv"), "The service's type.", required=True,
            example="std_srvs/srv/SetBool"),
        Key("server", RosName("the name of a service"), "The service.", required=True,
            example="light"),
        Key("request", Values(), "The fields of the request."),
        Key("timeout", SERVICE_TIMEOUT, "How long to wait; a bare duration is the answer's."),
        Key("retry", SERVICE_RETRY, "How often to try; a bare number is the attempts."),
        Key("expect", Condition(RESULT), "What the answer must be."),
        Key("save", Table(Place(RESULT)), "Names to keep parts of the answer under."),
        Key("namespace", NAMESPACE, "Put before a relative name."),
        interface=Interface("srv", "server", "request", "Request", "result", "Response"),
    )  # fmt: skip
    yield _leaf(
        "publish",
        TOPIC_NAME,
        "Publishes a message. While a process is new (3.5 s), who listens may not be discovered "
        "yet, so it waits for one until then; where nobody listens it succeeds with a warning.",
        "publish: lamp\ntype: std_msgs/msg/Bool\nmessage: {data: true}",
        MESSAGE_TYPE,
        Key("message", Values(), "The fields of the message."),
        Key("subscribers", Whole(1), "So many must listen before it publishes.",
            default="whoever is there"),
        Key("timeout", Duration(or_none=True), default="none",
            doc="After which it fails where fewer listen; not while a process is new."),
        Key("qos", QOS, "How it is published.", default="default"),
        Key("namespace", NAMESPACE, "Put before a relative name."),
        interface=Interface("msg", "publish", "message"),
    )  # fmt: skip
    yield _leaf(
        "wait_for_message",
        NodeName(),
        "Succeeds with the first message, since it started, that fits.",
        "wait_for_message: The door opens\ntopic: door\ntype: std_msgs/msg/Bool\n"
        "until: message.data\ntimeout: 60 s",
        Key("topic", TOPIC_NAME, "The topic.", required=True, example="door"),
        MESSAGE_TYPE,
        Key("until", Condition(_MESSAGE), "What the message must be.", default="any message"),
        Key("timeout", Duration(or_none=True), "After which it fails.", default="none"),
        Key("save", Table(Place(_MESSAGE)), "Names to keep parts of the message under."),
        Key("qos", QOS, "How the topic is subscribed to.", default="default"),
        Key("namespace", NAMESPACE, "Put before a relative name."),
        interface=Interface("msg", "topic", root="message"),
    )
    yield _leaf(
        "wait", Duration(zero=True, values=True), "Succeeds after some time.", "wait: 500 ms"
    )
    yield _leaf(
        "wait_until",
        Condition(),
        "Succeeds as soon as the expression is true.",
        "wait_until: $level > 0.2\ntimeout: 60 s",
        Key("timeout", Duration(or_none=True), "After which it fails.", default="none"),
    )
    yield _leaf(
        "set",
        Table(AnyValue()),
        "Gives variables their values, all or none.",
        "set: {count: = $count + 1}",
    )
    yield _leaf(
        "log",
        Text(values=True),
        "Writes a line to the log. It never fails: `(no value)` stands for what has none.",
        "log: The level is $(level)\nlevel: warn",
        Key("level", Choice(("debug", "info", "warn", "error", "fatal")), "How grave it is.",
            default="info"),
        reads="",  # it never fails
    )  # fmt: skip
    yield _leaf(
        "python",
        Text("a class, such as package.module.Class, as a text"),
        "A behaviour of one's own, made with its name and `arguments`.",
        "python: py_trees.behaviours.Periodic\narguments: {n: 3}",
        Key("arguments", Values(), "For its constructor; of an enum, a member's name."),
    )
    yield _leaf(
        "check",
        Condition(),
        "Succeeds when the expression is true, and fails when it is not or cannot be computed.",
        "check: $level > 0.2",
    )
    yield _leaf(
        "subtree",
        Text("a tree's file or name, as a text"),
        "Another tree: it sees only what `with` passes, and gives back outputs by `save`.",
        "subtree: recover\nwith: {home: 0.0}",
        Key("with", Values(), "Values for the tree's inputs."),
        Key("save", Table(Name()), "Names here for the tree's outputs."),
        Key("namespace", NAMESPACE, "Put before all relative names of the tree."),
        reads="with",
    )
    for name, doc in (
        ("success", "Succeeds at once."),
        ("failure", "Fails at once."),
        ("running", "Never ends."),
    ):
        yield _leaf(name, NodeName(optional=True), doc, f"{name}: As it is")


KINDS: Mapping[str, Kind] = MappingProxyType({kind.name: kind for kind in _all()})
"""Every kind of node, by its key."""
