"""Nav2's control nodes in our language, and its leaves that are no action and no service there."""

from __future__ import annotations

from bt_actions.importing.given import Given, Handler
from bt_actions.importing.names import milliseconds, ros_name
from bt_actions.importing.project import PLACE, SELECTORS, variable_in
from bt_actions.importing.report import Verdict
from bt_actions.importing.scripts import Refused
from bt_actions.importing.text import Node

CANCELS = (
    *("CancelControl", "CancelSpin", "CancelBackUp", "CancelDriveOnHeading", "CancelWait"),
    *("CancelAssistedTeleop", "CancelComputeAndTrackRoute", "CancelFollowObject"),
)
"""Leaves that have a server cancel all of its goals."""
_AT_ONCE = ("check", "set", "log", "success", "failure", "publish")


def takes_time(node: Node) -> bool:
    """Return whether a node is a leaf that does not end at once."""
    leaf = not {"child", "children", "then"} & node.keys()
    return leaf and next(iter(node)) not in _AT_ONCE


def _recovery(given: Given) -> Node:
    retries = given.whole("number_of_retries", "1")
    children = given.children()
    if len(children) != 2:
        raise Refused("children")
    attempts = retries + 1 if isinstance(retries, int) else f"= {retries} + 1"
    node = Node(retry=given.name(), attempts=attempts, child=children[0])
    if attempts != 1:
        node["recover"] = children[1]
    return node


def _pipeline(given: Given) -> Node:
    children = given.children()
    *before, last = [each for each in children if not each.dropped] or children
    bare = [
        Node(every="none", child=each) if takes_time(each) else each for each in before
    ]  # a node that was written keeps its result there, as long as the pipeline runs
    for each, inner in zip(bare, before, strict=True):
        if each is not inner:
            each.comments, inner.comments = inner.comments, []
    return Node(pipeline=given.name(), children=[*bare, last])


def _persistent(given: Given) -> Node:
    """Write a sequence that keeps the place in its port, until the sequence ends."""
    name = variable_in(given.text(PLACE), PLACE)
    if name is None:
        raise Refused("port", f"{PLACE} names no variable")
    place = given.scope[name]
    given.converted(PLACE, "a child that runs is not left where another node writes the port")
    steps = [
        Node(sequence=f"Child {number}", only_if=f"${place} == {number}",
             children=[child, Node(set={place: number + 1})])
        for number, child in enumerate(given.children())
    ]  # fmt: skip
    again = Node(set={place: 0})
    failed = Node(force_failure="Begin anew", child=again)
    return Node(
        fallback=given.name(),
        children=[Node(sequence="From the place on", children=[*steps, again]), failed],
    )


def _rate(given: Given) -> Node:
    text = given.text("hz", "10.0")
    child = given.only_child()
    if given.around != "PipelineSequence":
        given.converted("hz", "only in a pipeline does it keep to a rate, there as well")
        given.differs("dropped: its parent begins it anew at each tick, so that it paces nothing")
        return child
    try:
        period = round(1000.0 / float(text))
    except (ValueError, ZeroDivisionError):
        raise Refused("port", f"hz={text!r} is no rate") from None
    return Node(every=milliseconds(period), child=child)


def _when_new(given: Given) -> Node:
    for name in ("goal", "goals", "input_goal", "input_goals"):
        given.dropped(name, "an input does not change in a run")
    child = given.only_child()
    if given.around == "PipelineSequence":
        given.differs("a new goal is a new run: serve --policy replace")
        return Node(every="none", child=child)
    return child


def _goal_updated(given: Given) -> Node:
    for name in ("goal", "goals"):
        given.dropped(name, "an input does not change in a run")
    why = "a new goal is a new run: serve --policy replace"
    given.writer.report.node(given.element, Verdict.DROPPED, why)
    node = Node(failure=given.name())
    node.dropped = True
    return node


def _cancel(given: Given) -> Node:
    for name in ("server_name", "service_name", "server_timeout"):
        given.dropped(name, "nothing is sent")
    given.differs("a leaf that is not ticked any more cancels its goal; goals of others go on")
    return Node(success=given.name())


def _selector(given: Given) -> Node:
    what = SELECTORS[given.kind].removeprefix("selected_")
    output = SELECTORS[given.kind]
    name = variable_in(given.text(output), output)
    if name is None:
        raise Refused("port", f"{output} names no variable")
    default = given.text(f"default_{what}", "")
    topic = {
        "topic": ros_name(given.text("topic_name", f"{what}_selector")),
        "type": "std_msgs/msg/String",
        "qos": "latched",
        "default": {"data": default},
    }
    given.writer.words["topics"][given.scope[name].partition(".")[0]] = topic
    node = Node(success=given.name())
    node.dropped = True
    given.differs("it is a topic of the tree")
    return node


def _goal_updater(given: Given) -> Node:
    name = variable_in(given.text("output_goal"), "output_goal")
    goal = given.reference("input_goal")
    if name is None or goal is None:
        raise Refused("port", "its ports name no variables")
    for each in ("input_goals", "output_goals"):
        given.dropped(each, "one goal is taken over")
    given.writer.words["topics"][given.scope[name]] = {
        "topic": ros_name(given.text("goal_updater_topic", "goal_update")),
        "type": "geometry_msgs/msg/PoseStamped",
        "default": goal,
    }
    given.differs("it is a topic of the tree, with the goal as its default")
    return given.only_child()


NAV2: dict[str, Handler] = {
    "RecoveryNode": _recovery,
    "PipelineSequence": _pipeline,
    "PersistentSequence": _persistent,
    "RateController": _rate,
    "GoalUpdated": _goal_updated,
    "GlobalUpdatedGoal": _goal_updated,
    "GoalUpdatedController": _when_new,
    **dict.fromkeys(CANCELS, _cancel),
    **dict.fromkeys(SELECTORS, _selector),
    "GoalUpdater": _goal_updater,
}
