"""`invert`: success where the child fails, and failure where it succeeds."""

from bt_actions.document.kinds.given import Behaviour, Context, Hazards, TreeNode, leaving, py_trees
from bt_actions.document.language.kinds import Can, End, decorator
from bt_actions.document.language.values import names_value
from bt_actions.document.yaml.nodes import span_of


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    if context.document.gated:
        return leaving.Invert(node.name, child)
    return py_trees.decorators.Inverter(node.name, child)


def _warn(hazards: Hazards, node: TreeNode, _bounded: bool) -> None:
    """Report a check without a message, whose failure is a success here: BT314."""
    asked = [inner for child in node.children for inner in child.walk()]
    kinds = {inner.kind for inner in asked}
    if not all(kind.in_turn or (kind.only_asks and not kind.slow) for kind in kinds):
        return
    topics = hazards.document.topics.items()
    silent = {name for name, topic in topics if "default" not in topic.values}
    reads = (read for inner in asked for read in hazards.checker.reads.get(id(inner), ()))
    of_topics = (
        (name, read)
        for read in reads
        for name in read.expression.variables
        if name in silent and name not in read.expression.asked
    )
    topic, first = next(of_topics, ("", None))
    if first is None or hazards.doubts.below(node):
        return
    hint = "write 'not' in the check itself, which fails while it has no value"
    if asked[0].values.get("check") is first:
        text = first.expression.text.strip()
        hint = f"check: not {text if names_value(text) else f'({text})'}"
    hazards.source.report(
        "BT314", span_of(node.key), f"this also succeeds while ${topic} has no message", hint=hint
    )


KIND = decorator(
    "invert",
    "Succeeds when its child fails, and fails when its child succeeds.",
    "invert: Nobody there\nchild:\n  failure: Somebody",
    build=_build, warn=_warn, goes_on=End.FAILURE,
    ends=lambda _values, inner, _at_once: Can(inner[0].fail, inner[0].succeed),
)  # fmt: skip
