"""`wait`: some time."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, leaves
from bt_actions.document.language.kinds import Can, leaf
from bt_actions.document.language.scalars import Duration
from bt_actions.document.language.values import computed_in


def _build(node: TreeNode, context: Context) -> Behaviour:
    return leaves.Wait(context.named(node, "wait {}"), context.value(node.values["wait"]))


KIND = leaf(
    "wait", Duration(zero=True, values=True), "Succeeds after some time.", "wait: 500 ms",
    build=_build, begun=True,
    ends=lambda values, _inner, _at_once: Can(True, bool(computed_in(values.get("wait")))),
)  # fmt: skip
