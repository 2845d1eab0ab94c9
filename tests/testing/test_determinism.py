"""In virtual time, without rclpy, a run is the same to the letter in every process.

pick_and_place goes from YAML to SUCCESS; and a dozen goals at once meet faults of all kinds, and
are interrupted.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
RUNS = 5
PROGRAM = f"""
import json, sys, time

sys.modules["rclpy"] = None  # an import of it raises

from py_trees.common import ParallelPolicy
from py_trees.composites import Parallel
from robot_control_interfaces.action import MoveRobot as Move
from bt_actions import MoveRobot, Retry, Timeouts, load_tree
from bt_actions.events.wire import to_plain
from bt_actions.testing import Script, ScriptedServer, Simulation, VirtualNetwork, VirtualRunner

TREE = "trees/pick_and_place.yaml"


def run():
    began = time.process_time()
    network = VirtualNetwork()
    simulation = Simulation(network)
    runner = VirtualRunner(load_tree(TREE), network)
    status = runner.run()
    took = time.process_time() - began
    said = [status.name, simulation.describe(), runner.unaccounted, network.log.lines]
    return took, [said, [to_plain(event) for event in runner.events]]


def storm():
    network = VirtualNetwork()
    faults = ["*:30%:abort", "*:30%:drop_accept", "*:40%:reject_cancel", "*:15%:die", "*:10%:stall"]
    names = [f"move_{{number}}" for number in range(12)]
    script = Script(duration=8.0)
    servers = [ScriptedServer(network, Move, name, script, faults=faults, seed=5) for name in names]
    retry = Retry(9, backoff=0.3, jitter=0.5, outcomes=["ABORTED", "SERVER_LOST"])
    waits = Timeouts(server=3.0, accept=1.0, result=30.0, cancel=1.0)
    leaves = [MoveRobot(name, 1.0, action_name=name, timeout=waits, retry=retry) for name in names]
    policy = ParallelPolicy.SuccessOnAll(synchronise=False)
    runner = VirtualRunner(Parallel("All", policy, children=leaves), network)
    runner.start()
    runner.advance(3.5)
    runner.interrupt()
    status = runner.advance(60.0)
    said = [status.name, [str(goal) for goal in runner.unaccounted], network.log.lines]
    return [said, [to_plain(event) for event in runner.events]]


run()  # imports what is imported when it is first wanted
took, stories = zip(*(run() for _ in range({RUNS})))
storms = [storm() for _ in range({RUNS})]
json.dump({{"took": took, "stories": stories, "storms": storms}}, sys.stdout)
"""


def runs(hash_seed: str) -> dict[str, Any]:
    environment = os.environ | {"PYTHONHASHSEED": hash_seed}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True, text=True, check=False, cwd=ROOT, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_every_run_is_the_same_and_takes_no_time() -> None:
    both = [runs("1"), runs("2")]
    stories = [story for each in both for story in each["stories"]]
    said, events = stories[0]
    assert said == ["SUCCESS", "The part lies at 4.99 m, at the shelf.", [], []]
    goals = [event for event in events if event["kind"] == "GoalChanged"]
    assert len({goal["goal_id"] for goal in goals}) == 5
    assert events[-1]["at"][1] > 10.0, "the robot takes its time, and we do not"
    assert all(story == stories[0] for story in stories)
    assert min(seconds for each in both for seconds in each["took"]) <= 0.05
    storms = [storm for each in both for storm in each["storms"]]
    (_, unaccounted, _), events = storms[0]
    assert len(unaccounted) > 2
    assert len(events) > 80
    assert all(storm == storms[0] for storm in storms)
