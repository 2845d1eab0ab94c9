"""`wait_until`: a condition that will hold."""

from typing import Any

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, leaves
from bt_actions.document.language.kinds import EITHER, SUCCEEDS, leaf
from bt_actions.document.language.scalars import Condition, Duration
from bt_actions.document.language.shapes import Key


def _build(node: TreeNode, context: Context) -> Behaviour:
    timeout: Any = node.values.get("timeout")
    holds = context.holds(node.values["wait_until"])
    return leaves.WaitUntil(context.named(node, "wait until {}"), holds, timeout)


KIND = leaf(
    "wait_until",
    Condition(),
    "Succeeds as soon as the expression is true.",
    "wait_until: $level > 0.2\ntimeout: 60 s",
    Key("timeout", Duration(or_none=True), "The time after which the node fails.", default="none"),
    build=_build, slow=True, ends=lambda _values, _inner, at_once: SUCCEEDS if at_once else EITHER,
)  # fmt: skip
