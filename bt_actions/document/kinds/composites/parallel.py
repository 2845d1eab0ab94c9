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
        "{at_least: N, fails_after: N}",
        keyed(
            Key("at_least", Whole(1, word="all"), "So many must succeed.", default="all"),
            Key(
                "fails_after",
                Whole(1),
                "After so many failures the node fails at once.",
                default="when too few can succeed",
            ),
        ),
    ),
)


def _build(node: TreeNode, _context: Context, *children: Behaviour) -> Behaviour:
    policy = node.values.get("policy")
    numbers = table_of(policy)
    needed = 1 if policy == "one" else numbers.get("at_least")
    return parallel.Parallel(
        node.name,
        children,
        at_least=None if needed == "all" else needed,
        fails_after=numbers.get("fails_after"),
    )


def _check(checker: Checker, node: TreeNode) -> None:
    numbers = table_of(node.values.get("policy"))
    for key, end in (("at_least", "succeed"), ("fails_after", "fail")):
        wanted = numbers.get(key)
        if isinstance(wanted, int) and wanted > len(node.children) > 0:
            at = locate(node.written["policy"], (key,))
            text = f"{wanted} children can never {end}: there are {len(node.children)}"
            checker.source.report("BT110", span_of(at), text)


def warn_of_resources(hazards: Hazards, node: TreeNode, _bounded: bool) -> None:
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
    policy = values.get("policy", "all")
    everything = policy == "all" or (
        isinstance(policy, dict) and policy.get("at_least", "all") == "all"
    )
    enough = all if everything else any
    return Can(enough(end.succeed for end in inner), any(end.fail for end in inner))


_SEMANTICS = """
`policy: {at_least: 2, fails_after: 1}` succeeds with the second success, and fails with the first
failure. Without `fails_after` the node fails when too few children can still succeed.
"""
KIND = composite(
    "parallel",
    "Ticks its children side by side, each to its end. The node decides after each child "
    "whether it has succeeded or failed, and then begins no further child.",
    "parallel: Look and listen\nchildren:\n  - success: Look\n  - success: Listen",
    Key("policy", _POLICY, "How many children must succeed; the node then stops the others.",
        default="all"),
    build=_build, check=_check, warn=warn_of_resources, ends=_ends, again=End.ANY,
    semantics=_SEMANTICS,
)  # fmt: skip
