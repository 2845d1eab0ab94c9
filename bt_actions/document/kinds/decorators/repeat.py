"""`repeat`: another round after a success."""

from bt_actions.document.checking.verdicts import of_rounds
from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, decorators
from bt_actions.document.language.kinds import Can, End, Settings, decorator
from bt_actions.document.language.scalars import Condition, Whole
from bt_actions.document.language.shapes import Key


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    times = context.value(node.values["times"]) if "times" in node.values else None
    until = context.holds(node.values["until"]) if "until" in node.values else None
    return decorators.Repeat(node.name, child, times, until)


def _check(checker: Checker, node: TreeNode) -> None:
    checker.condition(node.values.get("until"), {})


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    succeed, fail = inner[0]
    limit = values.get("times")
    if "until" in values:
        return Can(succeed, True)
    if at_once:  # each round after the first is a tick later
        return Can(succeed and limit in (0, 1), fail)
    known = isinstance(limit, int)  # a limit that is computed may be none, and may be zero
    return Can(
        limit is not None and (succeed or limit == 0 or not known),
        (fail and limit != 0) or not (known or limit is None),
    )


def _seconds(values: Settings, inner: list[float]) -> float:
    times = values.get("times")
    return of_rounds(inner[0], times if isinstance(times, int) else 1)


_SEMANTICS = """
| after a round | the node |
|---|---|
| FAILURE | FAILURE |
| SUCCESS, and `until` is true | SUCCESS |
| SUCCESS, and `until` has no value | FAILURE |
| SUCCESS in the last of `times` | SUCCESS; with `until`, FAILURE |
| SUCCESS | RUNNING; the next round begins at the next tick, which comes at once |
"""
KIND = decorator(
    "repeat",
    "Ticks its child again after each success; fails with the first failure.",
    "repeat: Three rounds\ntimes: 3\nchild:\n  success: Patrol",
    Key("times", Whole(0, values=True), "The number of rounds.", default="for ever", example="3"),
    Key("until", Condition(),
        "A condition after each round that has succeeded: true ends the node with SUCCESS."),
    build=_build, check=_check, semantics=_SEMANTICS,
    ends=_ends, seconds=_seconds, slow=True, again=End.SUCCESS,
)  # fmt: skip
