"""`publish`: a message on a topic."""

from typing import Any

from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, parts, topics
from bt_actions.document.language.keys import MESSAGE_TYPE, NAMESPACE, QOS, TOPIC_NAME
from bt_actions.document.language.kinds import SUCCEEDS, Can, Interface, Settings, leaf
from bt_actions.document.language.scalars import Duration, Whole
from bt_actions.document.language.shapes import Key, Values
from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.tree import text_of
from bt_actions.document.yaml.nodes import span_of


def _build(node: TreeNode, context: Context) -> Behaviour:
    values: dict[str, Any] = node.values
    return topics.Publish(
        context.named(node, "publish {}"),
        parts.interface_in(values, "msg", context),
        context.name(values, "publish"),
        context.value(values.get("message", {})),
        qos=text_of(values, "qos") or "default",
        subscribers=values.get("subscribers", 0),
        timeout=values.get("timeout"),
    )


def _check(checker: Checker, node: TreeNode) -> None:
    alone = "timeout" in node.values and "subscribers" not in node.values
    if alone and not checker.doubts.own(node):
        said = "'timeout' is how long to wait for 'subscribers', which are missing"
        at = span_of(node.written["timeout"])
        checker.source.report("BT108", at, said, hint="subscribers: 1")


def _ends(values: Settings, _inner: list[Can], at_once: bool) -> Can:
    waits = values.get("timeout") is not None
    return SUCCEEDS if at_once else Can(True, waits or bool(computed_in(values.get("message"))))


KIND = leaf(
    "publish",
    TOPIC_NAME,
    "Publishes a message. In the first 3.5 s of a process the node waits for a subscriber, as "
    "discovery takes time. Without a subscriber the node succeeds with a warning.",
    "publish: lamp\ntype: std_msgs/msg/Bool\nmessage: {data: true}",
    MESSAGE_TYPE,
    Key("message", Values(), "The fields of the message."),
    Key("subscribers", Whole(1), "The number of subscribers that the node waits for.",
        default="any number"),
    Key("timeout", Duration(or_none=True), default="none",
        doc="The wait for subscribers, then FAILURE; at least the first 3.5 s of the process."),
    Key("qos", QOS, "The quality of service of the publisher.", default="default"),
    Key("namespace", NAMESPACE, "Put before a relative name."),
    interface=Interface("msg", "publish", "message"),
    build=_build, check=_check, ends=_ends, slow="subscribers", computes=True,
)  # fmt: skip
