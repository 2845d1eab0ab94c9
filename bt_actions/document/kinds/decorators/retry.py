"""`retry`: another try after a failure, and pauses between the tries."""

from typing import Any

from bt_actions.document.checking.verdicts import of_tries
from bt_actions.document.kinds.given import Behaviour, Context, Hazards, TreeNode, decorators
from bt_actions.document.language.kinds import Can, End, Settings, decorator
from bt_actions.document.language.scalars import Duration, Quantity, Whole
from bt_actions.document.language.shapes import Key
from bt_actions.document.yaml.nodes import span_of
from bt_actions.goals.policy import Retry


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    values: dict[str, Any] = node.values
    given = {key: values[key] for key in ("backoff", "factor", "max_backoff") if key in values}
    attempts = context.value(values["attempts"]) if "attempts" in values else None
    return decorators.RetryChild(node.name, child, attempts, Retry(**given))


def _warn(hazards: Hazards, node: TreeNode, bounded: bool) -> None:
    if not bounded and "attempts" not in node.values and not hazards.doubts.own(node):
        hint = "attempts: N, or a 'timeout' around it"
        hazards.source.report("BT304", span_of(node.key), "this retry never gives up", hint=hint)


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    succeed, fail = inner[0]
    limit = values.get("attempts")
    if at_once:  # each try after the first is a tick later
        return Can(succeed, fail and limit in (0, 1))
    known = isinstance(limit, int)
    return Can(succeed, limit is not None and (fail or not known))


KIND = decorator(
    "retry",
    "Ticks its child again when it has failed.",
    "retry: Until it holds\nattempts: 3\nbackoff: 500 ms\nchild:\n  success: Grasp",
    Key("attempts", Whole(1, values=True), "All tries.", default="without limit", example="3"),
    Key("backoff", Duration(zero=True), "The pause before the second try.", default="0 s"),
    Key("factor", Quantity(1.0), "Each pause is this much longer.", default="2"),
    Key("max_backoff", Duration(zero=True), "The longest pause.", default="60 s"),
    build=_build, warn=_warn, ends=_ends, slow=True, again=End.FAILURE,
    seconds=lambda values, inner: of_tries(inner[0], values),
)  # fmt: skip
