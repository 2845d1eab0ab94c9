"""`force_success` and `force_failure`: one end, however the child ends."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, leaving, py_trees
from bt_actions.document.language.kinds import Can, End, decorator


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    succeeds = node.kind.name == "force_success"
    if context.document.gated:
        return (leaving.ForceSuccess if succeeds else leaving.ForceFailure)(node.name, child)
    both = py_trees.decorators
    make = both.FailureIsSuccess if succeeds else both.SuccessIsFailure
    return make(node.name, child)


KINDS = (
    decorator(
        "force_success",
        "Succeeds when its child has ended, with SUCCESS or FAILURE.",
        "force_success: If possible\nchild:\n  failure: Wave",
        build=_build, ends=lambda _values, inner, _: Can(any(inner[0]), False), goes_on=End.ANY,
    ),
    decorator(
        "force_failure",
        "Fails when its child has ended, with SUCCESS or FAILURE.",
        "force_failure: Give up\nchild:\n  success: Go home",
        build=_build, ends=lambda _values, inner, _: Can(False, any(inner[0])),
    ),
)  # fmt: skip
