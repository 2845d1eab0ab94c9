"""`check`: a condition that holds, or does not."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, leaves
from bt_actions.document.language.kinds import leaf
from bt_actions.document.language.scalars import Condition
from bt_actions.document.language.values import Computed


def _build(node: TreeNode, context: Context) -> Behaviour:
    written = node.values["check"]
    assert isinstance(written, Computed)
    name = context.named(node, "{}", written.expression.text)
    return leaves.Check(name, written.expression, context.read)


KIND = leaf(
    "check",
    Condition(),
    "Succeeds when the expression is true, and fails when it is false or has no value.",
    "check: $level > 0.2",
    build=_build,
)
