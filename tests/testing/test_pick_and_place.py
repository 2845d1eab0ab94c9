"""pick_and_place runs from YAML to SUCCESS in virtual time, without rclpy, and always the same."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
RUNS = 5
PROGRAM = f"""
import dataclasses, json, sys, time

sys.modules["rclpy"] = None  # an import of it raises

from py_trees.behaviour import Behaviour
from bt_actions import load_tree
from bt_actions.testing import Simulation, VirtualNetwork, VirtualRunner

TREE = "trees/pick_and_place.yaml"


def told(event):
    fields = {{each.name: getattr(event, each.name) for each in dataclasses.fields(event)}}
    names = {{key: v.name if isinstance(v, Behaviour) else str(v) for key, v in fields.items()}}
    return [type(event).__name__, names]


def run():
    began = time.process_time()
    network = VirtualNetwork()
    simulation = Simulation(network)
    runner = VirtualRunner(load_tree(TREE), network)
    status = runner.run()
    took = time.process_time() - began
    said = [status.name, simulation.describe(), runner.unaccounted, network.log.lines]
    return took, [said, [told(event) for event in runner.events]]


load_tree(TREE)
runs = [run() for _ in range({RUNS})]
took, stories = zip(*runs)
json.dump({{"took": took, "stories": stories}}, sys.stdout)
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


def test_it_delivers_the_part_in_virtual_time_the_same_in_every_run() -> None:
    both = [runs("1"), runs("2")]
    stories = [story for each in both for story in each["stories"]]
    said, events = stories[0]
    assert said == ["SUCCESS", "The part lies at 4.99 m, at the shelf.", [], []]
    goals = [fields for kind, fields in events if kind == "GoalChanged"]
    assert len({goal["goal_id"] for goal in goals}) == 5
    assert float(events[-1][1]["time"]) > 10.0, "the robot takes its time, and we do not"
    assert all(story == stories[0] for story in stories)
    assert max(seconds for each in both for seconds in each["took"]) <= 0.05
