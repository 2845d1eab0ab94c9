"""`parallel`: children beside each other."""

from bt_actions.document.findings import Related
from bt_actions.document.kinds.given import Behaviour, Checker, Context, Hazards, TreeNode, parallel
from bt_actions.document.language.keys import keyed
from bt_actions.document.language.kinds import Can, End, Settings, composite
from bt_actions.document.language.scalars import Choice, Whole
from bt_actions.document.language.shapes import Key, OneOf, Record
from bt_actions.document.language.values import locate
from bt_actions.document.reading.tree import resources_below, table_of
from bt_actions.document.yaml.nodes import span_of

_POLICY = OneOf(
    Choice(("all", "one")),
    Record(
        "{at_least: N}",
        keyed(Key("at_least", Whole(1), "So many must succeed.", required=True, example="2")),
    ),
)


def _build(node: TreeNode, _context: Context, *children: Behaviour) -> Behaviour:
    policy = node.values.get("policy")
    needed = 1 if policy == "one" else table_of(policy).get("at_least")
    return parallel.Parallel(node.name, children, at_least=needed)


def _check(checker: Checker, node: TreeNode) -> None:
    least = table_of(node.values.get("policy")).get("at_least")
    if isinstance(least, int) and least > len(node.children) > 0:
        at = locate(node.written["policy"], ("at_least",))
        text = f"{least} children can never succeed: there are {len(node.children)}"
        checker.source.report("BT110", span_of(at), text)


def _warn(hazards: Hazards, node: TreeNode, _bounded: bool) -> None:
    """Report two branches that need one resource: BT303."""
    taken: dict[str, TreeNode] = {}
    for child in node.children:
        below = resources_below(child, hazards.document, known=hazards.held)
        for resource, user in below.items():
            first = taken.get(resource.lstrip("/"))
            if first is None or hazards.doubts.below(node):
                continue
            where = user if user.source is hazards.source else child
            hazards.source.report(
                "BT303", span_of(where.key),
                f"this needs {resource!r}, and so does a branch beside it: only one can run",
                related=Related(first.place, "the other is here"),
                hint="busy: share, where both may run at once",
            )  # fmt: skip
            break
        for resource, user in below.items():
            taken.setdefault(resource.lstrip("/"), user)


def _ends(values: Settings, inner: list[Can], _at_once: bool) -> Can:
    enough = all if values.get("policy", "all") == "all" else any
    return Can(enough(end.succeed for end in inner), any(end.fail for end in inner))


KIND = composite(
    "parallel",
    "Ticks its children beside each other. A child that has finished is not started again; "
    "none is begun once the node has succeeded or failed, which is decided after each.",
    "parallel: Look and listen\nchildren:\n  - success: Look\n  - success: Listen",
    Key("policy", _POLICY, "How many must succeed; the rest is then stopped.", default="all"),
    build=_build, check=_check, warn=_warn, ends=_ends, again=End.ANY,
)  # fmt: skip
