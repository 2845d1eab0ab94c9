"""`sequence` and `fallback`: one child after the other, until one ends them all."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, py_trees
from bt_actions.document.language.kinds import Can, End, Settings, composite
from bt_actions.document.language.scalars import Flag
from bt_actions.document.language.shapes import Key

_MEMORY = Key(
    "memory", Flag(), default="true",
    doc="Whether a child that has finished is left alone; false makes the node reactive.",
)  # fmt: skip


def _build(node: TreeNode, _context: Context, *children: Behaviour) -> Behaviour:
    both = py_trees.composites
    make = both.Sequence if node.kind is KINDS[0] else both.Selector
    return make(node.name, node.values.get("memory", True) is True, children=list(children))


def _all_succeed(_values: Settings, inner: list[Can], _at_once: bool) -> Can:
    passes, stops = True, False
    for passes, fails in inner:
        stops = stops or fails
        if not passes:
            break
    return Can(passes, stops)


def _all_fail(values: Settings, inner: list[Can], at_once: bool) -> Can:
    turned = [Can(end.fail, end.succeed) for end in inner]
    return Can(*reversed(_all_succeed(values, turned, at_once)))


KINDS = (
    composite(
        "sequence",
        "Ticks its children in order until one fails; succeeds when all have.",
        "sequence: Fetch\nchildren:\n  - success: Go\n  - success: Grasp",
        _MEMORY,
        build=_build, ends=_all_succeed, goes_on=End.SUCCESS,
        seconds=lambda _values, inner: sum(inner),
    ),
    composite(
        "fallback",
        "Ticks its children in order until one succeeds; fails when all have.",
        "fallback: Try both ways\nchildren:\n  - failure: Left\n  - success: Right",
        _MEMORY,
        build=_build, ends=_all_fail, goes_on=End.FAILURE,
        seconds=lambda _values, inner: sum(inner),
    ),
)  # fmt: skip
