"""`every`: how often a child of a `pipeline`, or of a `repeat`, begins again."""

from bt_actions.document.kinds.given import Behaviour, Context, Hazards, TreeNode, decorators
from bt_actions.document.language.kinds import Can, End, Group, decorator
from bt_actions.document.language.scalars import Duration
from bt_actions.document.yaml.nodes import span_of


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    period = node.values["every"]
    assert period is None or isinstance(period, float)
    return decorators.Every(context.named(node, "every {}"), child, period)


def _warn(hazards: Hazards, node: TreeNode, _bounded: bool) -> None:
    """Report an `every` that nothing begins again within a visit: BT324."""
    above = hazards.above(node)
    while above is not None and above.kind.group is Group.DECORATOR and above.kind.name != "repeat":
        above = hazards.above(above)
    if above is None or above.kind.name in ("pipeline", "repeat"):  # a tree may be included in one
        return
    if not hazards.doubts.below(above):
        hazards.source.report(
            "BT324", span_of(node.key), f"{above.key.text!r} never begins this again",
            hint="'every' stands below a 'pipeline', or a 'repeat'",
        )  # fmt: skip


_SEMANTICS = """
| when | the node |
|---|---|
| a visit begins, and the period has passed, or the child has not succeeded yet | ticks its child, \
and has its status |
| a visit begins within the period | RUNNING, without a tick of the child |
| the child runs | ticks its child |
| the node has failed, or was stopped | forgets the last success |

With `every: none` the child succeeds once, until the node has failed or was stopped: in a
`pipeline`, once in a visit.
"""
KIND = decorator(
    "every",
    "Begins its child at once, and again when a period has passed since the child's last success.",
    "every: 1 s\nchild:\n  success: Plan",
    value=Duration(or_none=True),
    build=_build, warn=_warn, slow=True, goes_on=End.SUCCESS, semantics=_SEMANTICS, paces=True,
    ends=lambda _values, inner, _at_once: Can(*inner[0]),
)  # fmt: skip
