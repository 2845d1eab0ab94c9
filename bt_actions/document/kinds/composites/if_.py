"""`if`: one of two nodes, as a condition says."""

from bt_actions.document.findings import Related
from bt_actions.document.kinds.given import Behaviour, Context, Hazards, TreeNode, composites
from bt_actions.document.language.keys import NODE, ConditionOrNode, keyed
from bt_actions.document.language.kinds import NAME, Can, Group, Kind, Settings
from bt_actions.document.language.scalars import Flag
from bt_actions.document.language.shapes import Key
from bt_actions.document.language.values import Computed
from bt_actions.document.yaml.nodes import span_of


def _build(node: TreeNode, context: Context, *children: Behaviour) -> Behaviour:
    asked, memory = node.values.get("if"), node.values.get("memory", True) is True
    if isinstance(asked, Computed):
        name = context.named(node, "if {}", asked.expression.text)
        return composites.If(name, context.holds(asked), *children, memory=memory)
    name = context.named(node, "if {}", children[0].name)
    return composites.If(name, *children, memory=memory)


def _warn(hazards: Hazards, node: TreeNode, _bounded: bool) -> None:
    """Report a condition that never changes, and one that takes time and is asked at each tick."""
    asked = node.values.get("if")
    if isinstance(asked, Computed):
        hazards.constant(asked)
    if asked is not None or node.values.get("memory") is not False:
        return
    asked = node.children[0]
    if hazards.takes_time(asked) and not hazards.doubts.below(node):
        hazards.source.report(
            "BT306", span_of(asked.key),
            "this condition takes time, and begins again at each tick",
            related=Related(node.place, "because of 'memory: false' here"),
        )  # fmt: skip


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    computed = "if" in values
    asked, branches = ([], inner) if computed else (inner[:1], inner[1:])
    if not all(map(any, asked)):
        return Can(False, False)
    fails = len(branches) < 2 or (computed and not at_once)
    return Can(any(end.succeed for end in branches), fails or any(end.fail for end in branches))


_SEMANTICS = """
| the condition | the node |
|---|---|
| is true, or succeeds | ticks `then`, and has its status |
| is false, or fails | ticks `else`, and has its status; without an `else`, FAILURE |
| has no value | FAILURE |
| RUNNING | RUNNING, and stops no branch |

A failure of one branch does not begin the other. With `memory: false` the other branch begins when
the stopped goals have ended.
"""
KIND = Kind(
    "if", Group.COMPOSITE, ConditionOrNode(),
    "Ticks `then` or `else`, as a condition decides, and ends as that branch does. The condition "
    "is an expression, or a node that succeeds or fails.",
    keyed(
        Key("then", NODE, "The node for a true condition.", required=True, example="{success: Go}"),
        Key("else", NODE, "The node for a false condition.", default="fails"),
        Key("memory", Flag(), default="true",
            doc="Whether the node keeps its choice to its end; with false the node decides before "
            "each tick, and stops the other branch."),
        NAME,
    ),
    "if: $level > 0.2\nthen:\n  success: Work\nelse:\n  success: Charge",
    build=_build, reads="if", warn=_warn, ends=_ends, semantics=_SEMANTICS,
)  # fmt: skip
