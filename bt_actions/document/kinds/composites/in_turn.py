"""`sequence` and `fallback`: one child after the other, until a child ends the node."""

from bt_actions.document.kinds.given import (
    Behaviour,
    Checker,
    Context,
    TreeNode,
    composites,
    leaving,
    py_trees,
)
from bt_actions.document.language.kinds import Can, End, Settings, composite
from bt_actions.document.language.scalars import Flag
from bt_actions.document.language.shapes import Key
from bt_actions.document.yaml.nodes import span_of


def _memory(more: str = "", word: str = "") -> Key:
    return Key(
        "memory", Flag(word=word), default="true",
        doc="Whether a visit ticks a finished child only once; false makes the node "
        f"reactive.{more}",
    )  # fmt: skip


def _sequence(node: TreeNode, context: Context, *children: Behaviour) -> Behaviour:
    memory = node.values.get("memory", True)
    if memory == "resume":
        return composites.Resume(node.name, children)
    make = leaving.Sequence if context.document.gated else py_trees.composites.Sequence
    return make(node.name, memory is True, children=list(children))


def _fallback(node: TreeNode, context: Context, *children: Behaviour) -> Behaviour:
    if node.values.get("in_turn") is True:
        return composites.InTurn(node.name, children)
    make = leaving.Fallback if context.document.gated else py_trees.composites.Selector
    return make(node.name, node.values.get("memory", True) is True, children=list(children))


def _check_turns(checker: Checker, node: TreeNode) -> None:
    if node.values.get("in_turn") is True and node.values.get("memory") is False:
        checker.source.report(
            "BT110", span_of(node.written["memory"]),
            "'in_turn' keeps its place while a child runs: nothing here is reactive",
        )  # fmt: skip


def all_succeed(_values: Settings, inner: list[Can], _at_once: bool) -> Can:
    passes, stops = True, False
    for passes, fails in inner:
        stops = stops or fails
        if not passes:
            break
    return Can(passes, stops)


def _all_fail(values: Settings, inner: list[Can], at_once: bool) -> Can:
    turned = [Can(end.fail, end.succeed) for end in inner]
    return Can(*reversed(all_succeed(values, turned, at_once)))


_TURNS = """
With `in_turn: true` a visit begins after the child that has succeeded last. The visit tries each
child once, and goes on from the last child to the first:

| child | the node |
|---|---|
| SUCCESS | SUCCESS; the next visit begins after this child |
| FAILURE | tries the next child; when all have failed: FAILURE, and the next visit begins with \
the first child |
| RUNNING | RUNNING |
| stopped | the next visit begins with the first child |

The node keeps its place from visit to visit, as long as the tree is loaded.
"""
_RESUMES = """
With `memory: resume` a visit after a failure, or after a stop, begins with the child that failed or
was stopped. A visit after a success begins with the first child.
"""
KINDS = (
    composite(
        "sequence",
        "Ticks its children in order; fails when a child fails, and succeeds when all have "
        "succeeded.",
        "sequence: Fetch\nchildren:\n  - success: Go\n  - success: Grasp",
        _memory(" resume begins where the last visit failed.", "resume"),
        build=_sequence, ends=all_succeed, goes_on=End.SUCCESS, semantics=_RESUMES,
        seconds=lambda _values, inner: sum(inner),
    ),
    composite(
        "fallback",
        "Ticks its children in order; succeeds when a child succeeds, and fails when all have "
        "failed.",
        "fallback: Try both ways\nchildren:\n  - failure: Left\n  - success: Right",
        _memory(),
        Key("in_turn", Flag(), "Whether a visit begins after the child that has succeeded last.",
            default="false"),
        build=_fallback, check=_check_turns, ends=_all_fail, goes_on=End.FAILURE,
        semantics=_TURNS, seconds=lambda _values, inner: sum(inner),
    ),
)  # fmt: skip
