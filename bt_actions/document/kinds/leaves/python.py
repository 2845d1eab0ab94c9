"""`python`: a behaviour of one's own."""

from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, py_trees
from bt_actions.document.language.kinds import leaf
from bt_actions.document.language.scalars import Text
from bt_actions.document.language.shapes import Key, Values
from bt_actions.document.language.values import computed_in, locate
from bt_actions.document.reading.tree import table_of, text_of
from bt_actions.document.yaml.nodes import Node, span_of


def _build(node: TreeNode, context: Context) -> Behaviour:
    """Make a behaviour; report a failure to the document's source, and return `Failure` instead."""
    from bt_actions.document.language.classes import ClassError, make_behaviour, refusal

    path = text_of(node.values, "python")
    name = node.name or path.rpartition(".")[2]
    if refused := refusal(path, context.python):  # nothing is imported, whatever the checker said
        node.source.report("BT214", span_of(node.key), refused)
        return py_trees.behaviours.Failure(name)
    try:
        return make_behaviour(path, name, table_of(node.values.get("arguments")))
    except ClassError as error:
        code, at = "BT214", node.written["python"]
        if "arguments" in node.written:
            code, at = "BT215", node.written["arguments"]
        node.source.report(code, span_of(at), str(error))
        return py_trees.behaviours.Failure(name)


def _check(checker: Checker, node: TreeNode) -> None:
    from bt_actions.document.language.classes import (
        ClassError,
        find_behaviour,
        refusal,
        wrong_arguments,
    )

    path, arguments = node.values.get("python"), node.values.get("arguments", {})
    if refused := refusal(path, checker.python):
        checker.source.report("BT214", span_of(node.key), refused)
        return
    computed = computed_in(arguments)
    for one in computed:
        text = "an argument is a plain value: the class is made before the tree runs"
        checker.source.report("BT204", span_of(one.node), text)
    if computed or not isinstance(path, str) or not checker.types:
        return
    try:
        cls = find_behaviour(path)
    except ClassError as error:
        checker.source.report("BT214", span_of(node.written["python"]), str(error))
        return
    if issubclass(cls, py_trees.timers.Timer):
        text = "this timer goes by the wall clock: it cannot be run in virtual time"
        checker.source.report("BT316", span_of(node.written["python"]), text, hint="wait: 5 s")
    if not isinstance(arguments, dict):
        return
    for wrong in wrong_arguments(cls, arguments):
        at: Node = node.key
        if wrong.name:
            at = locate(node.written["arguments"], (wrong.name,), at_key=wrong.at_key)
        checker.source.report("BT215", span_of(at), wrong.text)


KIND = leaf(
    "python",
    Text("a class, such as package.module.Class, as a text"),
    "A behaviour of your own, made with its name and `arguments`.",
    "python: py_trees.behaviours.Periodic\narguments: {n: 3}",
    Key("arguments", Values(), "Arguments of the constructor; for an enum, a member's name."),
    build=_build, check=_check, slow=True,
)  # fmt: skip
