"""Constructs over actions in virtual time: goals that are stopped end before others begin."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Bool

from bt_actions import ActionBehaviour, Outcome
from bt_actions.behaviours.composites import If, Recover
from bt_actions.behaviours.leaving import Invert, Sequence
from bt_actions.document import DocumentError, InputError, tree_outputs
from bt_actions.events import GoalChanged, NodeChanged
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner

Load = Callable[..., Behaviour]
HEAD = """
tree: t
topics: {near: {topic: near, type: std_msgs/msg/Bool, qos: latched}}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 30 s}
  lift: {type: robot_control_interfaces/action/MoveRobot, server: lift, timeout: 30 s}
root:
"""


@pytest.fixture
def network() -> VirtualNetwork:
    """A robot and a lift: a goal takes as many seconds as its distance says, and aborts below 0."""
    network = VirtualNetwork()
    for name in ("move_robot", "lift"):
        script = Script(
            duration=lambda goal: abs(goal.distance),
            aborts=lambda goal: "backwards" if goal.distance < 0.0 else None,
        )
        ScriptedServer(network, MoveRobot, name, script, faults=[f"{name}:*:delay_cancel=1"])
    return network


def states(runner: VirtualRunner) -> list[str]:
    """What became of the goals, in order."""
    return [
        f"{runner.state.nodes[event.node].node.name} {event.state}"
        for event in runner.events
        if isinstance(event, GoalChanged) and event.state in ("EXECUTING", "DONE")
    ]


def test_a_tree_recovers_and_tells_its_rounds(load: Load, network: VirtualNetwork) -> None:
    root = load(f"""{HEAD}
  retry: R
  attempts: 3
  child: {{move: Back, goal: {{distance: -1.0}}}}
  recover: {{lift: Up, goal: {{distance: 1.0}}}}
""")
    assert isinstance(root, Recover)
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.FAILURE
    assert [name for name, _ in runner.outcomes] == ["Back", "Up", "Back", "Up", "Back"]
    assert "Back, round 3 of 3 of R" in repr(runner)


def test_the_other_branch_begins_when_the_goal_of_the_first_has_ended(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"""{HEAD}
  if: $near.data
  memory: false
  then: {{move: Slowly, goal: {{distance: 3.0}}}}
  else: {{lift: Up, goal: {{distance: 3.0}}}}
""")
    assert isinstance(root, If)
    network.publish("near", Bool(data=True), latched=True)
    runner = VirtualRunner(root, network)
    runner.start()
    runner.advance(1.0)
    network.publish("near", Bool(data=False), latched=True)
    runner.advance(0.5)
    assert root.feedback_message == "waiting for Slowly to end"
    assert runner.run() is Status.SUCCESS
    assert states(runner) == ["Slowly EXECUTING", "Slowly DONE", "Up EXECUTING", "Up DONE"]


def test_a_condition_waits_for_the_first_message_of_its_topic(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"{HEAD}  if: $near.data\n  then: {{success: A}}\n  else: {{failure: B}}\n")
    publisher = network.publisher(Bool, "near", latched=True)
    runner = VirtualRunner(root, network)
    runner.start()
    assert runner.advance(0.5) is None
    assert root.feedback_message == "waiting for a first message: $near"
    publisher.publish(Bool(data=True))
    assert runner.run() is Status.SUCCESS


def test_a_condition_whose_topic_is_silent_fails_and_chooses_nothing(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"{HEAD}  if: $near.data\n  then: {{success: A}}\n  else: {{success: B}}\n")
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.FAILURE
    assert root.feedback_message.startswith("no message has come on /near yet ($near)")


def test_a_goal_that_is_left_out_ends_before_its_parent_goes_on(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"""{HEAD}
  sequence: S
  children:
    - move: Slowly
      goal: {{distance: 3.0}}
      only_while: $near.data
    - lift: Up
      goal: {{distance: 1.0}}
""")
    network.publish("near", Bool(data=True), latched=True)
    runner = VirtualRunner(root, network)
    runner.start()
    runner.advance(1.0)
    network.publish("near", Bool(data=False), latched=True)
    runner.advance(0.5)
    slowly = root.children[0]
    assert slowly.feedback_message == "$near.data is false; waiting for Slowly to end"
    assert runner.run() is Status.SUCCESS
    assert states(runner) == ["Slowly EXECUTING", "Slowly DONE", "Up EXECUTING", "Up DONE"]
    ended = [
        event for event in runner.events if isinstance(event, NodeChanged) and event.is_left_out
    ]
    assert [runner.state.nodes[event.node].node.name for event in ended] == ["Slowly"]


def test_a_gate_is_told_with_its_node_and_is_no_failure(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"""{HEAD}
  fallback: F
  children:
    - {{success: A, only_if: $near.data}}
    - {{failure: B}}
""")
    network.publish("near", Bool(data=False), latched=True)
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.FAILURE
    assert [failure.node.name for failure in runner.state.failures] == ["B"]
    gated = next(each.node for each in runner.state.nodes.values() if each.node.name == "A")
    assert gated.settings == {"only_if": "$near.data"}
    assert not runner.state.dealt_with


def test_a_gate_waits_for_a_first_message_and_then_fails_with_what_to_ask(
    load: Load, network: VirtualNetwork
) -> None:
    network.publisher(Bool, "near", latched=True)
    root = load(f"{HEAD}  success: A\n  only_if: $near.data\n")
    runner = VirtualRunner(root, network)
    runner.start()
    assert runner.advance(0.5) is None
    assert runner.run() is Status.FAILURE
    assert root.feedback_message.startswith("only_if: no message has come on /near yet")
    assert root.feedback_message.endswith("; 'known($near)' asks whether it has a value")


def test_without_a_gate_a_tree_is_made_of_py_trees_own_composites(load: Load) -> None:
    tree = "tree: t\nroot: {{sequence: S{0}, children: [{{invert: I, child: {{failure: A}}}}]}}\n"
    plain, gated = load(tree.format("")), load(tree.format(", only_if: 1 == 1"))
    assert [type(plain), type(plain.children[0])] == [composites.Sequence, decorators.Inverter]
    assert [type(gated), type(gated.children[0])] == [Sequence, Invert]


def test_gates_of_a_tree_that_is_included_reach_the_one_around_it(load: Load) -> None:
    inner = "tree: inner\ninputs: {on: bool}\nroot: {success: A, only_if: $on}\n"
    root = load(
        "tree: t\nroot: {fallback: F, children: [{subtree: inner, with: {on: false}},"
        " {failure: B}]}\n",
        inner=inner,
    )
    runner = VirtualRunner(root)
    assert runner.run() is Status.FAILURE
    assert [failure.node.name for failure in runner.state.failures] == ["B"]


def test_what_is_planned_anew_meanwhile_is_planned_as_often_as_it_says(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"""{HEAD}
  pipeline: P
  children:
    - every: 1 s
      child: {{move: Plan, goal: {{distance: 0.5}}}}
    - lift: Follow
      goal: {{distance: 4.9}}
""")
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.SUCCESS
    assert [name for name, _ in runner.outcomes].count("Plan") == 4
    assert 5.0 < runner.now < 6.5


def sent(runner: VirtualRunner) -> list[float]:
    """The distances of all goals, in order."""
    return [
        event.goal["distance"]
        for event in runner.events
        if isinstance(event, GoalChanged) and event.state == "SENDING"
    ]


@pytest.mark.parametrize(
    ("on_change", "wanted"), [("ignore", [3.0]), ("replace", [3.0, 1.0]), ("cancel", [3.0, 1.0])]
)
def test_a_goal_follows_what_another_node_writes(
    load: Load, network: VirtualNetwork, on_change: str, wanted: list[float]
) -> None:
    root = load(f"""{HEAD}
  sequence: S
  children:
    - set: {{far: 3.0}}
    - parallel: P
      policy: one
      children:
        - {{lift: Follow, goal: {{distance: $far}}, on_change: {on_change}}}
        - sequence: Later
          children: [{{wait: 1 s}}, {{set: {{far: 1.0}}}}, {{wait: 1 h}}]
""")
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.SUCCESS
    assert sent(runner) == wanted


def test_a_subtree_hands_changed_inputs_on_while_it_runs(
    load: Load, network: VirtualNetwork
) -> None:
    inner = HEAD.replace("tree: t", "tree: inner\ninputs: {far: float64}").replace(
        "topics: {near: {topic: near, type: std_msgs/msg/Bool, qos: latched}}\n", ""
    )
    inner += "  {lift: Follow, goal: {distance: $far}, on_change: replace}\n"
    for on_change, wanted in (("pass", [3.0, 1.0]), ("ignore", [3.0])):
        root = load(
            f"""{HEAD}
  sequence: S
  children:
    - set: {{far: 3.0}}
    - parallel: P
      policy: one
      children:
        - {{subtree: inner, with: {{far: $far}}, on_change: {on_change}}}
        - sequence: Later
          children: [{{wait: 1 s}}, {{set: {{far: 1.0}}}}, {{wait: 1 h}}]
""",
            inner=inner,
        )
        runner = VirtualRunner(root, network)
        assert runner.run() is Status.SUCCESS
        assert sent(runner) == wanted


def test_a_node_that_is_left_out_at_its_begin_waits_for_no_goal_of_an_earlier_visit(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(
        HEAD.replace("tree: t", "tree: t\ninputs: {go: {type: bool, default: true}}")
        + """
  repeat: R
  times: 2
  child:
    parallel: P
    policy: one
    children:
      - {move: A, goal: {distance: 5.0}, only_if: $go}
      - {sequence: S, children: [{wait: 500 ms}, {set: {go: false}}]}
"""
    )
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.SUCCESS
    told = [event.state for event in runner.events if isinstance(event, GoalChanged)]
    assert told[-3:] == ["EXECUTING", "CANCELING", "DONE"], "and no goal follows"


def test_what_a_failure_tells_is_zero_before_and_kept_where_nothing_came(
    load: Load, network: VirtualNetwork
) -> None:
    ScriptedServer(network, MoveRobot, "codes", faults=["codes:1:abort", "codes:2:reject"])
    root = load("""
tree: t
outputs: {before: int32, code: int32, why: string, then: string, at_last: string}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: codes, timeout: 30 s,
         save_on_failure: {code: result.status, why: outcome}}
root:
  sequence: S
  children:
    - set: {before: = $code}
    - {force_success: F, child: {move: First}}
    - set: {then: $why}
    - {force_success: F, child: {move: Second}}
    - set: {at_last: $why}
    - move: Third
""")
    assert VirtualRunner(root, network).run() is Status.SUCCESS
    told = tree_outputs(root)
    assert told == {"before": 0, "code": 0, "then": "ABORTED", "at_last": "REJECTED", "why": ""}


UNTIL = (
    HEAD
    + """  lift: Up
  goal: {distance: 4.0}
  expect: "false"
  until: feedback.current_pose > 1.0
  retry: 3
"""
)


@pytest.mark.parametrize(
    ("faults", "status", "outcome"),
    [
        ([], Status.SUCCESS, Outcome.SUCCEEDED),
        (["lift:*:succeed_on_cancel"], Status.SUCCESS, Outcome.SUCCEEDED),
        (["lift:*:abort_on_cancel"], Status.FAILURE, Outcome.CANCELED),
    ],
)
def test_feedback_that_is_enough_ends_a_goal_and_is_a_success(
    load: Load, faults: list[str], status: Status, outcome: Outcome
) -> None:
    network = VirtualNetwork()
    script = Script(
        duration=4.0, feedback=lambda goal, done: MoveRobot.Feedback(current_pose=4.0 * done)
    )
    ScriptedServer(network, MoveRobot, "lift", script, faults=faults)
    runner = VirtualRunner(load(UNTIL), network)
    assert runner.run() is status
    assert runner.outcomes == [("Up", outcome)]
    assert 1.0 < runner.now < 2.0


def test_what_feedback_tells_is_kept_while_a_goal_runs_and_when_it_has_failed(load: Load) -> None:
    network = VirtualNetwork()
    script = Script(
        duration=4.0, feedback=lambda goal, done: MoveRobot.Feedback(current_pose=4.0 * done)
    )
    ScriptedServer(network, MoveRobot, "lift", script, faults=["lift:1:abort"])
    outputs = "{before: bool, lacked: bool, failed: float64, seen: float64, at: float64}"
    root = load(
        HEAD.replace("tree: t", f"tree: t\noutputs: {outputs}")
        + """
  sequence: S
  children:
    - set: {before: = known($at), zero: 0.0}
    - force_success: F
      child:
        lift: Up
        save_feedback: {at: feedback.current_pose, no: feedback.current_pose / $zero}
    - set: {failed: $at, lacked: = not known($no)}
    - set: {at: 0.0}
    - parallel: P
      policy: one
      children:
        - {lift: Up, save_feedback: {at: feedback.current_pose}}
        - {sequence: T, children: [{wait_until: $at > 3.0}, {set: {seen: $at}}]}
    - {lift: Up, until: feedback.current_pose < $at, save_feedback: {at: feedback.current_pose}}
"""
    )
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.SUCCESS
    told = tree_outputs(root)
    assert (told["before"], told["lacked"]) == (False, True)
    assert 0.0 < told["failed"] < 4.0
    assert 3.0 < told["seen"] < 3.5
    assert told["at"] < 1.0, "until is asked first"


def test_a_topic_with_a_default_has_a_value_from_the_beginning(
    load: Load, network: VirtualNetwork
) -> None:
    root = load("""
tree: t
inputs: {start: {type: std_msgs/msg/Bool, default: {data: true}}}
outputs: {first: bool, second: bool, third: bool}
topics:
  near: {topic: near, type: std_msgs/msg/Bool, max_age: 1 s, default: $start}
  far: {topic: far, type: std_msgs/msg/Bool, default: {data: true}}
root:
  sequence: S
  children:
    - set: {first: $near.data, third: $far.data}
    - wait: 1 s
    - set: {second: $near.data}
    - wait: 2 s
    - check: $near.data
""")
    runner = VirtualRunner(root, network)
    runner.start()
    runner.advance(0.5)
    network.publish("near", Bool(data=False))
    assert runner.run() is Status.SUCCESS
    assert tree_outputs(root) == {"first": True, "second": False, "third": True}


INNER = """
tree: inner
inputs: {who: string, at: {type: string, default: near}}
topics: {near: {topic: $(at), type: std_msgs/msg/Bool, default: {data: true}}}
root:
  action: Go
  type: robot_control_interfaces/action/MoveRobot
  server: $(who)/move
  timeout: 3 s
  only_if: $near.data
"""
OUTER = """
tree: outer
inputs: {{robot: {{type: string, default: r1}}}}
root:
  sequence: S
  children:
    - {{subtree: inner, with: {{who: r2}}}}
    - {{subtree: inner, with: {{who: {who}}}, namespace: $(robot)}}
"""


def servers(root: Behaviour) -> list[str]:
    return [node.action_name for node in root.iterate() if isinstance(node, ActionBehaviour)]


def test_inputs_are_put_into_names_all_the_way_down(load: Load) -> None:
    assert servers(load(OUTER.format(who="$robot"), inner=INNER)) == ["r2/move", "r1/r1/move"]
    root = load(OUTER.format(who="$(robot)b"), {"robot": "/a"}, inner=INNER)
    assert servers(root) == ["r2/move", "/ab/move"]


def test_a_name_that_ros_refuses_is_refused_with_the_input_that_makes_it(load: Load) -> None:
    with pytest.raises(InputError, match=r"\$\(robot\) would be 'no name', as robot is 'no name'"):
        load(OUTER.format(who="$robot"), {"robot": "no name"}, inner=INNER)


def test_what_a_subtree_needs_before_it_runs_is_no_variable(load: Load) -> None:
    text = OUTER.format(who="$said").replace("children:", "children:\n    - set: {said: r1}")
    with pytest.raises(DocumentError, match=r"\$said is no input"):
        load(text, inner=INNER)


def test_a_node_waits_for_no_first_message_where_there_is_a_default(
    load: Load, network: VirtualNetwork
) -> None:
    network.publisher(Bool, "near", latched=True)
    head = HEAD.replace("qos: latched}", "qos: latched, default: {data: true}}")
    runner = VirtualRunner(load(f"{head}  check: $near.data\n"), network)
    assert runner.run() is Status.SUCCESS
    assert runner.now < 0.1


def test_what_waits_anyway_waits_for_a_first_message_only_for_its_gate(
    load: Load, network: VirtualNetwork
) -> None:
    network.publisher(Bool, "near", latched=True)
    text = f"{HEAD}  wait_until: $near.data\n  timeout: 500 ms\n"
    runner = VirtualRunner(load(text), network)
    assert runner.run() is Status.FAILURE
    assert runner.now < 0.8
    began = runner.now
    runner = VirtualRunner(load(f"{text}  only_if: $near.data\n"), network)
    assert runner.run() is Status.FAILURE
    assert runner.now - began > 0.8
