"""`run_tree`: a goal to a server of trees."""

from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, parts, run_tree
from bt_actions.document.language.keys import ACTION_SERVER, DOING, POLICIES, TIMEOUT
from bt_actions.document.language.kinds import Interface, leaf
from bt_actions.document.language.scalars import Condition, NodeName, Place, Text
from bt_actions.document.language.shapes import Key, Table, Values
from bt_actions.document.reading.tree import server_of, settings_of
from bt_actions.messages.fields import Scalar
from bt_actions.messages.interfaces import RUN_TREE

_RUN = frozenset({"result", "outputs"})


def _build(node: TreeNode, context: Context) -> Behaviour:
    settings = settings_of(node, context.document)
    return run_tree.RunTree(
        node.name,
        context.value(settings["tree"]),
        context.value(settings.get("inputs", {})),
        server=context.joined(settings, server_of(settings)),
        save=context.saved(settings.get("save"), run_tree.roots_of),
        **parts.goal_settings(settings, context, run_tree.roots_of, {"cancel": run_tree.CANCEL}),
    )


def _check(checker: Checker, node: TreeNode) -> None:
    text = node.values.get("tree")
    if text is not None:
        checker.value(Scalar("string"), text, node.written["tree"], prose=True)
    inputs, written = node.values.get("inputs"), node.written.get("inputs")
    if inputs is not None and written is not None:
        checker.value(None, inputs, written)
        checker.finite(inputs, written)


KIND = leaf(
    "run_tree",
    NodeName(),
    "Lets a server of trees (`bt-actions serve`) run a tree, and ends as that run does. Where a "
    "goal of that run is not accounted for, the end of this goal is UNKNOWN.",
    "run_tree: Fetch the part\ntree: fetch\nserver: /r1/run_tree\ninputs: {pick_at: 2.0}\n"
    "save: {at: outputs.at}",
    Key("tree", Text(values=True), "The tree's name at that server.", required=True,
        example="fetch"),
    Key("server", ACTION_SERVER, "The server's action.", default="run_tree"),
    Key("inputs", Values(), "Values for the tree's inputs."),
    Key("timeout", TIMEOUT, "As for an action, but with a default of 15 s for `cancel`: "
        "the run below drains its goals first."),
    *POLICIES[1:],
    Key("expect", Condition(_RUN), "A condition on `result`, or on `outputs`."),
    Key("save", Table(Place(_RUN)), "Variables for parts of the outputs."),
    *DOING[-2:],
    reads="inputs",
    interface=Interface(
        "action", "server", root="result", received="Result", more=("outputs",), type=RUN_TREE
    ),
    build=_build, check=_check, begun=True,
)  # fmt: skip
