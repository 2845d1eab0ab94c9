"""The public names as a user's own program has them, for the type checker; never run."""

from __future__ import annotations

from typing import Any, assert_type

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from bt_actions import (
    ActionBehaviour,
    AttemptRecord,
    Busy,
    End,
    GoalReport,
    Gripper,
    MoveRobot,
    Outcome,
    Progress,
    Retry,
    Timeouts,
    TreeRunner,
    Var,
    load_tree,
)
from bt_actions.testing import VirtualNetwork, VirtualRunner

leaf = ActionBehaviour(
    "any",
    "robot_control_interfaces/action/MoveRobot",
    "move_robot",
    {"distance": Var("pick_at")},
    timeout=Timeouts(result=30.0, feedback=None),
    retry=Retry(3, backoff=0.5, outcomes={Outcome.ABORTED, Outcome.REJECTED}),
    expect=lambda result: bool(result.final_pose > 0.0),
    save={"final_pose": "result.final_pose"},
    busy=Busy.WAIT,
    resources=["base"],
    on_feedback=lambda feedback: print(feedback.current_pose),
)
other = ActionBehaviour("as a function", "a/action/B", "b", lambda: {"x": 1}, busy="replace")
move = MoveRobot("move", 5.0, action_name="/r1/move_robot", timeout=10.0, retry=2)
grip = Gripper("grip", Var("grip_at"), max_effort=5.0)

assert_type(leaf.outcome, Outcome | None)
assert_type(leaf.end, End | None)
assert_type(leaf.attempt, int)
assert_type(leaf.history, list[AttemptRecord])
assert_type(leaf.progress(), Progress)
assert_type(leaf.result, Any)  # its class is only known when the program runs

root: Behaviour = Sequence("root", memory=True, children=[leaf, other, move, grip])
assert_type(load_tree("tree.yaml", inputs={"pick_at": 2.0}), Behaviour)

with TreeRunner(root, executor="single", heartbeat=0.05) as runner:
    assert_type(runner.run(timeout=60.0), Status)
    runner.start()
    runner.pause()
    runner.resume()
    runner.interrupt()
    assert_type(runner.wait(1.0), Status)
    assert_type(runner.unaccounted, list[GoalReport])

virtual = VirtualRunner(root, VirtualNetwork(), seed=1)
assert_type(virtual.run(timeout=60.0), Status)
assert_type(virtual.advance(1.0), Status | None)
assert_type(virtual.outcomes, list[tuple[str, Outcome]])
