"""The keys of trees: at the top, beside actions, topics, inputs and outputs, each with its form.

`document/kinds/` lists the kinds of nodes. Reading, checking, the JSON Schema and the reference
(docs/yaml.md) are all made from these two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from bt_actions.document.language.ros_names import RosName
from bt_actions.document.language.scalars import (
    Choice,
    Condition,
    Duration,
    Flag,
    Name,
    Place,
    Quantity,
    Schema,
    Shape,
    Text,
    TypeName,
    Whole,
)
from bt_actions.document.language.shapes import AnyValue, Key, ListOf, Record, Table, Values
from bt_actions.document.yaml.nodes import Node
from bt_actions.document.yaml.source import Source
from bt_actions.goals.policy import RETRYABLE, Busy


def keyed(*keys: Key) -> Mapping[str, Key]:
    return MappingProxyType({key.name: key for key in keys})


RESULT = frozenset({"result"})

TIMEOUT = Record(
    "a duration or a mapping of deadlines",
    keyed(
        Key("queue", Duration(or_none=True), "The wait for a free resource.", default="10 s"),
        Key("server", Duration(or_none=True), "The wait for a server in sight.", default="5 s"),
        Key("accept", Duration(or_none=True), "From the send to the acceptance.", default="5 s"),
        Key("result", Duration(or_none=True), "From the acceptance to the result.", default="none"),
        Key(
            "feedback", Duration(or_none=True), "The longest time without feedback.", default="none"
        ),
        Key("cancel", Duration(or_none=True), "From the cancel to the end.", default="5 s"),
    ),
    short="result",
)
_TRIES = (
    Key("attempts", Whole(1), "The number of attempts, the first one included.", default="1"),
    Key("backoff", Duration(zero=True), "The pause before the second try.", default="0 s"),
    Key("factor", Quantity(1.0), "Each pause is this much longer.", default="2"),
    Key("max_backoff", Duration(zero=True), "The longest pause.", default="60 s"),
    Key("jitter", Quantity(0.0, 1.0), "The share by which a pause varies.", default="0"),
)
_OUTCOMES = ListOf(Choice(tuple(sorted(outcome.value for outcome in RETRYABLE))), single=True)
_WHEN = Key(
    "when", Condition(RESULT), "Another attempt follows only where this holds for the result."
)
RETRY = Record(
    "a number of attempts or a mapping",
    keyed(*_TRIES, Key("outcomes", _OUTCOMES, "The outcomes that another attempt follows."), _WHEN),
    short="attempts",
)
SERVICE_TIMEOUT = Record(
    "a duration or a mapping of deadlines",
    keyed(
        Key("server", Duration(or_none=True), "The wait for the service.", default="5 s"),
        Key("response", Duration(or_none=True), "The wait for the answer.", default="5 s"),
    ),
    short="response",
)
SERVICE_RETRY = Record("a number of attempts or a mapping", keyed(*_TRIES, _WHEN), short="attempts")
NAMESPACE = RosName("a namespace", namespace=True)
POLICIES = (
    Key("timeout", TIMEOUT, "How long each phase may take; a bare duration is that of the result."),
    Key("retry", RETRY, "How often to try; a bare number is the number of attempts."),
    Key("busy", Choice(tuple(busy.value for busy in Busy)),
        "What to do when another goal has the server.", default="wait"),
)  # fmt: skip
FEEDBACK = frozenset({"feedback"})
FAILED = frozenset({"result", "outcome"})
SAVE_ON_FAILURE = Key(
    "save_on_failure", Table(Place(FAILED)),
    "Variables for parts of the result after a failure, or for the `outcome`.",
)  # fmt: skip
DOING = (
    Key("goal", Values(), "The fields of the goal; other fields keep their defaults."),
    Key("until", Condition(FEEDBACK),
        "A condition on the feedback: when it holds, the leaf cancels the goal and succeeds."),
    Key("on_change", Choice(("ignore", "replace", "cancel")),
        "The reaction to changed fields while the goal executes.",
        default="ignore"),
    *POLICIES,
    Key("expect", Condition(RESULT),
        "A condition on the result of a goal that succeeded; else UNEXPECTED_RESULT."),
    Key("save", Table(Place(RESULT)), "Variables for parts of the result."),
    SAVE_ON_FAILURE,
    Key("save_feedback", Table(Place(FEEDBACK)),
        "Variables for parts of each feedback, as the feedback comes."),
    Key("resources", ListOf(Text("a text")),
        "The resources of the goal, in place of its server; relative names as those of servers.",
        default="the server's name"),
    Key("namespace", NAMESPACE, "Put before a relative name of a server or resource."),
)  # fmt: skip
GATES = keyed(
    Key("only_if", Condition(), "Leave the node out where this is false at the begin of the node."),
    Key("only_while", Condition(),
        "Leave the node out where this is false before a tick, and stop the nodes below."),
)  # fmt: skip
"""The keys beside every kind."""
ACTION_KEYS = keyed(*DOING, *GATES.values())
"""The keys beside an action's alias."""
ACTION_TYPE = Key("type", TypeName("action"), "The action's type.", required=True,
                  example="robot_control_interfaces/action/MoveRobot")  # fmt: skip
ACTION_SERVER = RosName("the name of an action server")
ACTION_NAME = Key("server", ACTION_SERVER, "The action's name.", required=True,
                  example="move_robot")  # fmt: skip
MESSAGE_TYPE = Key("type", TypeName("msg"), "The message's type.", required=True,
                   example="std_msgs/msg/Bool")  # fmt: skip
_VALUE_TYPE = Key("type", TypeName("value"), "The value's type.", required=True, example="float64")
ALIAS = Record(
    "a mapping with type, server and settings",
    keyed(ACTION_TYPE, ACTION_NAME, *DOING),
)
INPUT = Record(
    "the type of an input",
    keyed(
        _VALUE_TYPE,
        Key(
            "default",
            AnyValue(),
            "The value where the caller gives none; without a default the caller must give one.",
        ),
        Key("unit", Text(), "For people."),
        Key("description", Text(), "For people."),
        Key(
            "secret",
            Flag(),
            "Whether to hide the value, and all values computed from it, from events, log and "
            "parameters.",
            default="false",
        ),
    ),
    short="type",
)
OUTPUT = Record(
    "the type of an output",
    keyed(
        _VALUE_TYPE,
        Key("unit", Text(), "For people."),
        Key("description", Text(), "For people."),
    ),
    short="type",
)
QOS = Choice(("default", "sensor", "latched", "best_effort", "services"))
TOPIC_NAME = RosName("the name of a topic")
TOPIC = Record(
    "a mapping with topic and type",
    keyed(
        Key("topic", TOPIC_NAME, "The topic's name.", required=True, example="door"),
        MESSAGE_TYPE,
        Key("qos", QOS, "The quality of service of the subscription.", default="default"),
        Key("max_age", Duration(or_none=True), default="none",
            doc="A value older than this, by the node's clock, counts as missing."),
        Key("default", AnyValue(), "The value before the first message; no node waits for one."),
        Key("namespace", NAMESPACE, "Put before a relative topic name."),
    ),
)  # fmt: skip
OWN_KIND = Record(
    "a class, or a mapping with python",
    keyed(
        Key("python", Text("a class, such as package.module.Class, as a text"),
            "A behaviour of py_trees, made with its name and its children.", required=True,
            example="my_robot.paths.Shorten"),
        Key("inputs", Table(INPUT), "Values that the class reads as `self.inputs.name`."),
        Key("outputs", Table(OUTPUT), "Values that the class sets as `self.outputs.name`."),
        Key("children", Choice(("none", "one", "many")), "The child nodes.", default="none"),
    ),
    short="python",
)  # fmt: skip
DEFAULTS = Record("a mapping of settings", keyed(*POLICIES))
_DESCRIPTION = Key("description", Text(), "The tree's purpose.")
_IMPORT = Key(
    "import",
    ListOf(Text("a path, as a text"), single=True),
    "Files that declare more actions, topics, kinds and defaults.",
)
_SHARED = (
    Key("actions", Table(ALIAS), "Short names for the actions of this tree."),
    Key(
        "topics", Table(TOPIC), "Topics whose latest messages are variables, read as `$name.field`."
    ),
    Key("kinds", Table(OWN_KIND), "Classes of your own as kinds of nodes."),
    Key("defaults", DEFAULTS, "Settings for all actions without a setting of their own."),
)


@dataclass(frozen=True)
class _Nodes:
    """A value that holds nodes of the tree, which `reading/nodes.py` reads."""

    words: str
    form: Schema

    def read(self, node: Node, source: Source) -> object:
        raise AssertionError("nodes are read by reading/nodes.py")

    def schema(self) -> Schema:
        return self.form


_NODE: Schema = {"$ref": "#/$defs/node"}
NODE: Shape = _Nodes("a node", _NODE)
NODES: Shape = _Nodes("a list of nodes", {"type": "array", "minItems": 1, "items": _NODE})


@dataclass(frozen=True, slots=True)
class ConditionOrNode(Condition):
    """A condition as an expression, or as a node that succeeds or fails."""

    words: str = "an expression or a node"

    def schema(self) -> Schema:
        return {"anyOf": [Condition().schema(), _NODE]}


TOP_KEYS = keyed(
    Key("tree", Name(), "The tree's name.", required=True, example="fetch"),
    _DESCRIPTION,
    _IMPORT,
    Key("namespace", NAMESPACE, "Put before all relative names of the tree."),
    Key("inputs", Table(INPUT), "Values from the caller of the tree."),
    Key("outputs", Table(OUTPUT), "Values that the tree gives back."),
    *_SHARED,
    Key("root", NODE, "The root node.", required=True, example="{success: Done}"),
)
"""The keys at the top of a tree."""
LIBRARY_KEYS = keyed(_DESCRIPTION, _IMPORT, *_SHARED)
"""The keys at the top of a file that is only imported."""
