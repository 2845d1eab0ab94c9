"""`pipeline`: earlier children begin again while a later child runs."""

from collections.abc import Sequence

from bt_actions.document.findings import Related
from bt_actions.document.kinds.composites.in_turn import all_succeed
from bt_actions.document.kinds.composites.parallel import warn_of_resources
from bt_actions.document.kinds.given import Behaviour, Context, Hazards, TreeNode, composites
from bt_actions.document.language.kinds import End, Group, composite
from bt_actions.document.yaml.nodes import span_of


def _build(node: TreeNode, _context: Context, *children: Behaviour) -> Behaviour:
    return composites.Pipeline(node.name, children)


def _warn(hazards: Hazards, node: TreeNode, bounded: bool) -> None:
    """Report one child alone, BT324, and children that begin again at each tick, BT306."""
    warn_of_resources(hazards, node, bounded)
    if hazards.doubts.below(node):
        return
    if len(node.children) == 1:
        text = "a pipeline of one child does what the child does"
        hazards.source.report("BT324", span_of(node.key), text)
    for child in hazards.begin_anew(_unpaced(node.children), End.SUCCESS):
        hazards.source.report(
            "BT306", span_of(child.key),
            f"this begins again at each tick after a success, while a later child of "
            f"{node.name!r} runs",
            hint="{every: 1 s, child: ...}, or {every: none, child: ...} for once in a visit",
            related=Related(node.place, "in this pipeline"),
        )  # fmt: skip


def _unpaced(children: Sequence[TreeNode]) -> list[TreeNode]:
    """Return the last child, and earlier children that nothing holds back after a success."""
    found = []
    for child in children:
        inner = child
        while not inner.kind.paces and inner.kind.group is Group.DECORATOR and inner.children:
            inner = inner.children[0]
        if not inner.kind.paces or child is children[-1]:
            found.append(child)
    return found


_SEMANTICS = """
| a child | the node |
|---|---|
| RUNNING, and no later child has begun in this visit | RUNNING; ticks no later child |
| RUNNING, and a later child has begun | ticks the next child |
| SUCCESS | ticks the next child; after the last: SUCCESS, and stops running children |
| FAILURE | FAILURE, and stops running children |

A child that has succeeded begins again at the next tick, as long as a later child runs; `every`
sets the pace. A new visit begins with the first child.
"""
KIND = composite(
    "pipeline",
    "Ticks its children in order; while a later child runs, earlier children begin again.",
    "pipeline: Follow\nchildren:\n  - every: 1 s\n    child:\n      success: Plan\n"
    "  - success: Follow the plan",
    build=_build, warn=_warn, ends=all_succeed, goes_on=End.SUCCESS, again=End.ANY,
    semantics=_SEMANTICS,
)  # fmt: skip
