"""`force_success` and `force_failure`: one end, however the child ends."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, py_trees
from bt_actions.document.language.kinds import Can, End, decorator


def _build(node: TreeNode, _context: Context, child: Behaviour) -> Behaviour:
    both = py_trees.decorators
    make = both.FailureIsSuccess if node.kind is KINDS[0] else both.SuccessIsFailure
    return make(node.name, child)


KINDS = (
    decorator(
        "force_success",
        "Succeeds when its child has finished, however.",
        "force_success: If possible\nchild:\n  failure: Wave",
        build=_build, ends=lambda _values, inner, _: Can(any(inner[0]), False), goes_on=End.ANY,
    ),
    decorator(
        "force_failure",
        "Fails when its child has finished, however.",
        "force_failure: Give up\nchild:\n  success: Go home",
        build=_build, ends=lambda _values, inner, _: Can(False, any(inner[0])),
    ),
)  # fmt: skip
