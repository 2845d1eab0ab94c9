"""`retry`: another try after a failure, and pauses between the tries."""

from typing import Any

from bt_actions.document.checking.verdicts import of_rounds, of_tries
from bt_actions.document.kinds.given import (
    Behaviour,
    Checker,
    Context,
    Hazards,
    TreeNode,
    composites,
    decorators,
)
from bt_actions.document.language.keys import NODE
from bt_actions.document.language.kinds import Can, End, Settings, decorator
from bt_actions.document.language.scalars import Duration, Quantity, Whole
from bt_actions.document.language.shapes import Key
from bt_actions.document.yaml.nodes import span_of
from bt_actions.goals.policy import Retry


def _build(node: TreeNode, context: Context, child: Behaviour, *recover: Behaviour) -> Behaviour:
    values: dict[str, Any] = node.values
    given = {key: values[key] for key in ("backoff", "factor", "max_backoff") if key in values}
    attempts = context.value(values["attempts"]) if "attempts" in values else None
    if recover:
        return composites.Recover(node.name, child, recover[0], attempts, Retry(**given))
    return decorators.RetryChild(node.name, child, attempts, Retry(**given))


def _check(checker: Checker, node: TreeNode) -> None:
    if "recover" in node.written and node.values.get("attempts") == 1:
        checker.source.report(
            "BT110", span_of(node.written["attempts"]),
            "'recover' never runs: no attempt follows the only one",
            hint="attempts: 2, or more; the first attempt counts",
        )  # fmt: skip


def _warn(hazards: Hazards, node: TreeNode, bounded: bool) -> None:
    if not bounded and "attempts" not in node.values and not hazards.doubts.own(node):
        hint = "attempts: N, or a 'timeout' around it"
        hazards.source.report("BT304", span_of(node.key), "this retry never gives up", hint=hint)


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    succeed, fail = inner[0]
    limit = values.get("attempts")
    known = isinstance(limit, int)
    if len(inner) > 1:  # tries follow each other in one tick, where there is a limit
        recovers, gives_up = inner[1]
        over = gives_up or (recovers and limit is not None)
        return Can(succeed, (fail and over) or not (known or limit is None))
    if at_once:  # each try after the first is a tick later
        return Can(succeed, fail and limit in (0, 1))
    return Can(succeed, limit is not None and (fail or not known))


def _seconds(values: Settings, inner: list[float]) -> float:
    attempts = values.get("attempts")
    between = of_rounds(sum(inner[1:]), attempts - 1) if isinstance(attempts, int) else 0.0
    return of_tries(inner[0], values) + between


_SEMANTICS = """
With `recover`:

| | `child` | `recover` |
|---|---|---|
| SUCCESS | SUCCESS | the next attempt; in the same tick, where `attempts` is set and no pause \
is due |
| FAILURE | `recover`, in the same tick; after the last attempt FAILURE | FAILURE |
| RUNNING | RUNNING | RUNNING |
| stopped | attempts begin at 1 | attempts begin at 1 |
"""
KIND = decorator(
    "retry",
    "Ticks its child again after a failure.",
    "retry: Until it holds\nattempts: 3\nbackoff: 500 ms\nchild:\n  success: Grasp",
    Key("attempts", Whole(1, values=True), "The number of attempts.", default="without limit",
        example="3"),
    Key("backoff", Duration(zero=True), "The pause before the second try.", default="0 s"),
    Key("factor", Quantity(1.0), "Each pause is this much longer.", default="2"),
    Key("max_backoff", Duration(zero=True), "The longest pause.", default="60 s"),
    Key("recover", NODE, "A node to run after each failure except the last, before the pause."),
    build=_build, check=_check, warn=_warn, ends=_ends, seconds=_seconds, slow=True,
    again=End.FAILURE, semantics=_SEMANTICS,
)  # fmt: skip
