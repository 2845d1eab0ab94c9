"""`for_each`: a round for each item of a list."""

from collections.abc import Iterator

from bt_actions.document.checking.value_types import INTEGER, named
from bt_actions.document.checking.verdicts import of_rounds
from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, decorators
from bt_actions.document.language.kinds import EITHER, Can, End, Settings, decorator
from bt_actions.document.language.scalars import Choice, Name
from bt_actions.document.language.shapes import Key, ListValue
from bt_actions.document.language.values import Computed
from bt_actions.document.reading.tree import text_of
from bt_actions.document.yaml.nodes import span_of
from bt_actions.messages.fields import Listing


def _build(node: TreeNode, context: Context, child: Behaviour) -> Behaviour:
    values = node.values
    item_name, index_name = text_of(values, "as") or "item", text_of(values, "index")

    def begin(item: object, index: int) -> None:
        context.write({item_name: item} | ({index_name: index} if index_name else {}))

    keep_going = values.get("on_failure") == "continue"
    return decorators.ForEach(
        node.name, child, context.value(values["in"]), begin, keep_going=keep_going
    )


def _check(checker: Checker, node: TreeNode) -> None:
    item, index = node.values.get("as", "item"), node.values.get("index")
    if item == index and "index" in node.written:
        text = f"the item and its index are both called {item!r}"
        checker.source.report("BT216", span_of(node.written["index"]), text)
    if isinstance(index, str) and index not in checker.document.topics:  # a topic is BT312's
        checker.assigns(index, INTEGER, node.written["index"])
    items = node.values.get("in")
    wanted = checker.variables.get(str(item)) if item in checker.declared_at else None
    if wanted is not None and item not in checker.document.topics and "in" in node.written:
        checker.value(Listing(wanted), items, node.written["in"], prose=True)
    elif isinstance(items, Computed):
        kind = checker.expression(items, {})
        if kind is not None and not isinstance(kind, Listing):
            text = f"a list is needed, and this is {named(kind)}"
            checker.source.report("BT204", span_of(items.node), text)
    elif "in" in node.written:
        checker.value(None, items, node.written["in"], prose=True)


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    items = values.get("in")
    if not at_once:
        return EITHER
    # each item after the first is a tick later
    return Can(inner[0].succeed and isinstance(items, list) and len(items) < 2, inner[0].fail)


def _seconds(values: Settings, inner: list[float]) -> float:
    items = values.get("in")
    return of_rounds(inner[0], len(items) if isinstance(items, list) else 1)


def _writes(values: Settings) -> Iterator[tuple[str, str, object, str | None]]:
    item, index = values.get("as", "item"), values.get("index")
    if isinstance(item, str):
        yield item, "as", values.get("in"), "item of"
    if isinstance(index, str):
        yield index, "index", 0, None


KIND = decorator(
    "for_each",
    "Ticks its child once for each item of a list.",
    "for_each: Every station\nin: [1.0, 2.0]\nas: station\nchild:\n  check: $station > 0",
    Key("in", ListValue(), "The list.", required=True, example="[1.0, 2.0]"),
    Key("as", Name(), "The variable that holds the item.", default="item"),
    Key("index", Name(), "A variable that counts the items, from 0."),
    Key("on_failure", Choice(("stop", "continue")),
        "Whether to go on when an item fails; with continue the node succeeds if any item did.",
        default="stop"),
    build=_build, check=_check, ends=_ends, seconds=_seconds, writes=_writes,
    slow=True, again=End.ANY,
)  # fmt: skip
