"""`wait_for_message`: the first message that fits."""

from typing import Any

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, parts, topics
from bt_actions.document.language.keys import MESSAGE_TYPE, NAMESPACE, QOS, TOPIC_NAME
from bt_actions.document.language.kinds import Interface, leaf
from bt_actions.document.language.scalars import Condition, Duration, NodeName, Place
from bt_actions.document.language.shapes import Key, Table
from bt_actions.document.reading.tree import text_of

_MESSAGE = frozenset({"message"})


def _build(node: TreeNode, context: Context) -> Behaviour:
    values: dict[str, Any] = node.values
    return topics.WaitForMessage(
        node.name,
        parts.interface_in(values, "msg", context),
        context.name(values, "topic"),
        qos=text_of(values, "qos") or "default",
        timeout=values.get("timeout"),
        read=parts.reader(
            values, context, "until", "message", lambda message: {"message": message}
        ),
    )


KIND = leaf(
    "wait_for_message",
    NodeName(),
    "Succeeds with the first message after its begin that meets the condition.",
    "wait_for_message: The door opens\ntopic: door\ntype: std_msgs/msg/Bool\n"
    "until: message.data\ntimeout: 60 s",
    Key("topic", TOPIC_NAME, "The topic.", required=True, example="door"),
    MESSAGE_TYPE,
    Key("until", Condition(_MESSAGE), "A condition on the message.", default="any message"),
    Key("timeout", Duration(or_none=True), "The time after which the node fails.", default="none"),
    Key("save", Table(Place(_MESSAGE)), "Variables for parts of the message."),
    Key("qos", QOS, "The quality of service of the subscription.", default="default"),
    Key("namespace", NAMESPACE, "Put before a relative name."),
    interface=Interface("msg", "topic", root="message"), build=_build, begun=True,
)  # fmt: skip
