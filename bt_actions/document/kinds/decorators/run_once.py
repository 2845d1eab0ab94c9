"""`run_once`: one visit of the child, whose end is kept."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, leaving, py_trees
from bt_actions.document.language.kinds import EITHER, End, decorator


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    policy = py_trees.common.OneShotPolicy.ON_COMPLETION
    if context.document.gated:
        return leaving.RunOnce(node.name, child, policy)
    return py_trees.decorators.OneShot(node.name, child, policy)


KIND = decorator(
    "run_once",
    "Runs its child to an end once, and repeats that status in later visits.",
    "run_once: Calibrate first\nchild:\n  success: Calibrate",
    build=_build, goes_on=End.SUCCESS, once=True,
    ends=lambda _values, inner, at_once: EITHER if at_once else inner[0],
)  # fmt: skip
