"""`repeat`: another round after a success."""

from bt_actions.document.checking.verdicts import of_rounds
from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, decorators
from bt_actions.document.language.kinds import Can, End, Settings, decorator
from bt_actions.document.language.scalars import Whole
from bt_actions.document.language.shapes import Key


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    times = context.value(node.values["times"]) if "times" in node.values else None
    return decorators.Repeat(node.name, child, times)


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    succeed, fail = inner[0]
    limit = values.get("times")
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


KIND = decorator(
    "repeat",
    "Ticks its child again when it has succeeded; fails as soon as it fails.",
    "repeat: Three rounds\ntimes: 3\nchild:\n  success: Patrol",
    Key("times", Whole(0, values=True), "All rounds.", default="for ever", example="3"),
    build=_build, ends=_ends, seconds=_seconds, slow=True, again=End.SUCCESS,
)  # fmt: skip
