"""`while`: a condition that must hold as long as the child runs."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, decorators, leaves
from bt_actions.document.language.kinds import Can, End, decorator
from bt_actions.document.language.scalars import Condition
from bt_actions.document.language.values import Computed


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    written, holds = node.values["while"], context.holds(node.values["while"])
    assert isinstance(written, Computed)

    def condition() -> bool:
        if holds():
            return True
        raise ValueError(
            f"the condition does not hold{leaves.stood_for(written.expression, context.read)}"
        )

    return decorators.While(context.named(node, "while {}"), child, condition)


KIND = decorator(
    "while",
    "Ticks its child as long as the expression is true; otherwise stops the child and fails. The "
    "node computes the expression before each tick.",
    "while: $level > 0.2\nchild:\n  success: Work",
    value=Condition(),
    build=_build, ends=lambda _values, inner, _at_once: Can(inner[0].succeed, True),
    goes_on=End.SUCCESS, again=End.ANY,
)  # fmt: skip
