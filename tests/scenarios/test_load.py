"""Load: fifty robots in one orchestrator, and the report against the journal, goal by goal."""

from __future__ import annotations

import signal
import time
from collections import Counter
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions import Gripper, MoveRobot, Retry, Timeouts, TreeRunner
from bt_actions.simulation.journal import live_intervals, max_live, read
from tests.scenarios.conftest import Launch
from tests.support.accounts import Report, compare
from tests.support.reliability import Record
from tests.support.trees import together

PATIENT = Timeouts(queue=60.0, server=60.0, accept=30.0, result=120.0, cancel=30.0)
"""Fifty robots on two slow cores are not quick; nothing here may fail for that."""


def cycles_of(namespace: str, cycles: int, retry: Retry) -> Behaviour:
    """A robot's work: fetch at 2 m, bring to 5 m, again and again."""
    policy: dict[str, Any] = {"timeout": PATIENT, "retry": retry}
    hand, move = f"{namespace}/gripper_control", f"{namespace}/move_robot"
    once = py_trees.composites.Sequence(
        f"cycle {namespace}",
        memory=True,
        children=[
            Gripper("open", 100.0, action_name=hand, **policy),
            MoveRobot("fetch", 2.0, action_name=move, **policy),
            Gripper("close", 0.0, action_name=hand, **policy),
            MoveRobot("bring", 5.0, action_name=move, **policy),
        ],
    )
    return py_trees.decorators.Repeat(f"robot {namespace}", child=once, num_success=cycles)


@pytest.mark.parametrize(
    ("robots", "cycles", "faults"),
    [
        (10, 3, 0),
        pytest.param(50, 20, 0, marks=[pytest.mark.chaos, pytest.mark.timeout(600)]),
        pytest.param(10, 10, 5, marks=[pytest.mark.chaos, pytest.mark.timeout(300)]),
    ],
)
def test_many_robots_in_one_orchestrator(
    robots: int,
    cycles: int,
    faults: int,
    launch: Launch,
    node: Any,
    tmp_path: Path,
    record: Record,
) -> None:
    """So many robots, so many cycles each at --speed 10, so many percent of goals aborted"""
    path = tmp_path / "journal.jsonl"
    fault = ["--fault", f"*:{faults}%:abort", "--seed", "1"] if faults else []
    arguments = ["--robots", str(robots), "--speed", "10", "--journal", str(path), *fault]
    sim = launch("sim", *arguments)
    sim.line("ready", within=60.0)
    names = [f"/r{number}" for number in range(1, robots + 1)]
    retry = Retry(5) if faults else Retry(1)
    root = together(*[cycles_of(each, cycles, retry) for each in names])
    report = Report()
    began = time.monotonic()
    with TreeRunner(root, node=node) as runner:
        runner.observe_events(report.note_goal)
        status = runner.run(timeout=550.0)
        failed = [leaf for leaf in root.iterate() if leaf.status is Status.FAILURE]
        assert status is Status.SUCCESS, [(leaf.name, leaf.feedback_message) for leaf in failed]
        assert runner.unaccounted == []
    took = time.monotonic() - began
    sim.send(signal.SIGINT)
    assert sim.wait() == 0, sim
    entries = read(path)
    ends = compare(report, entries)
    servers = {entry.server for entry in entries}
    assert len(servers) == 2 * robots
    assert {max_live(entries, server) for server in servers} == {1}
    wanted = robots * cycles * 4
    counted = Counter(ends.values())
    assert counted["succeeded"] == wanted
    record.took(took)
    together_at_once = max_live(entries)
    assert len(live_intervals(entries)) == len(ends)
    record.shows = (
        f"{len(ends)} goals on {len(servers)} servers: "
        + ", ".join(f"{number} {end}" for end, number in counted.items())
        + f"; up to {together_at_once} live at once, one a server; none executed twice"
    )
    record.outcome = "SUCCESS; 0 goals unaccounted for, report and journal agree on every goal"
