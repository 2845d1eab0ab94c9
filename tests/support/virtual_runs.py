"""Runs of trees on a simulated robot in virtual time, as events that `bt-actions` would record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path

from py_trees.common import Status

from bt_actions.cli.driving.drive import code_of
from bt_actions.document import load_tree
from bt_actions.events import Event, RunBegan, RunEnded
from bt_actions.testing import Simulation, VirtualNetwork, VirtualRunner

NIGHT = "examples/night/night.yaml"
"""A shift of 40 nodes."""
_days = count(20_000)


def run_of(
    tree: str | Path,
    *faults: str,
    inputs: Mapping[str, object] | None = None,
    speed: float = 10.0,
    seed: int = 0,
) -> list[Event]:
    """Return the events of a run on a day of its own, from the first to RunEnded."""
    network = VirtualNetwork()
    simulation = Simulation(network, faults=faults, speed=speed)
    runner = VirtualRunner(load_tree(tree, inputs), network, seed=seed)
    assert runner.run() is not Status.INVALID
    runner.shutdown()
    simulation.close()
    at = runner.events[-1].at
    events = [*runner.events, RunEnded(at._replace(number=at.number + 1), code_of(runner.state))]
    day = next(_days)
    return [_on(day, each) for each in events]


def _on(day: int, event: Event) -> Event:
    event = replace(event, at=event.at._replace(wall=event.at.wall + day * 86_400.0))
    return replace(event, run_id=f"{day:032x}"[::-1]) if isinstance(event, RunBegan) else event
