"""`log`: a line in the log."""

from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, leaves
from bt_actions.document.language.kinds import SUCCEEDS, leaf
from bt_actions.document.language.scalars import Choice, Text
from bt_actions.document.language.shapes import Key
from bt_actions.document.language.values import spoken
from bt_actions.document.reading.tree import text_of


def _build(node: TreeNode, context: Context) -> Behaviour:
    level, text = text_of(node.values, "level") or "info", node.values["log"]
    return leaves.Log(context.named(node, "log {}"), lambda: spoken(text, context.read), level)


def _check(checker: Checker, node: TreeNode) -> None:
    checker.value(None, node.values.get("log"), node.written["log"], prose=True)


KIND = leaf(
    "log",
    Text(values=True),
    "Writes a line to the log, and never fails: `(no value)` replaces a missing value.",
    "log: The level is $(level)\nlevel: warn",
    Key("level", Choice(("debug", "info", "warn", "error", "fatal")), "The severity.",
        default="info"),
    reads="",  # a log never fails
    build=_build, check=_check, ends=lambda _values, _inner, _at_once: SUCCEEDS,
)  # fmt: skip
