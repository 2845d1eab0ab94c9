"""`set`: values of variables."""

from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, leaves
from bt_actions.document.language.kinds import SUCCEEDS, Can, Settings, leaf
from bt_actions.document.language.shapes import AnyValue, Table
from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.tree import table_of
from bt_actions.document.yaml.nodes import Mapping


def _build(node: TreeNode, context: Context) -> Behaviour:
    written = table_of(node.values["set"])
    compute = context.value(written)
    name = context.named(node, "set {}", ", ".join(written))
    return leaves.SetValues(name, lambda: context.write(table_of(compute())))


def _check(checker: Checker, node: TreeNode) -> None:
    values, written = table_of(node.values.get("set")), node.written.get("set")
    for key, inner in written.pairs if isinstance(written, Mapping) else ():
        name, declared = key.text, key.text in checker.declared_at
        if name in values and declared and name in checker.document.topics:
            checker.assigns(name, None, key)
        elif name in values:
            checker.value(checker.variables.get(name) if declared else None, values[name], inner)


def _ends(values: Settings, _inner: list[Can], at_once: bool) -> Can:
    return SUCCEEDS if at_once else Can(True, bool(computed_in(values.get("set"))))


KIND = leaf(
    "set",
    Table(AnyValue()),
    "Gives variables their values, all or none.",
    "set: {count: = $count + 1}",
    build=_build, check=_check, ends=_ends, computes=True,
    writes=lambda values: (
        (name, "set", value, None) for name, value in table_of(values.get("set")).items()
    ),
)  # fmt: skip
