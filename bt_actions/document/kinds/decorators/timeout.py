"""`timeout`: an end of the child after some time."""

from bt_actions.document.kinds.given import Behaviour, Context, Hazards, TreeNode, decorators
from bt_actions.document.language.kinds import Can, End, Settings, decorator
from bt_actions.document.language.scalars import Duration
from bt_actions.document.language.shapes import Key
from bt_actions.document.yaml.nodes import span_of


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    return decorators.Deadline(node.name, child, context.value(node.values["after"]))


def _warn(hazards: Hazards, node: TreeNode, _bounded: bool) -> None:
    after = node.values.get("after")
    if not isinstance(after, float) or hazards.doubts.below(node):
        return
    needed = hazards.verdicts.budget(node.children[0], hazards.document)
    if after < needed:
        hazards.source.report(
            "BT307", span_of(node.written["after"]),
            f"{after:g} s are less than the {needed:g} s that the nodes inside may take",
            hint="the deadlines and retries inside would never have an effect",
        )  # fmt: skip


def _seconds(values: Settings, inner: list[float]) -> float:
    after = values.get("after")
    return min(after, inner[0]) if isinstance(after, float) else inner[0]


KIND = decorator(
    "timeout",
    "Stops its child after some time. The node then fails when the stopped goals have ended, or "
    "when their own 'cancel' deadlines have passed.",
    "timeout: Ten seconds at most\nafter: 10 s\nchild:\n  success: Search",
    Key("after", Duration(values=True), "How long the child may take.", required=True,
        example="10 s"),
    build=_build, warn=_warn, seconds=_seconds, goes_on=End.SUCCESS, bounds=True,
    ends=lambda _values, inner, at_once: Can(inner[0].succeed, inner[0].fail or not at_once),
)  # fmt: skip
