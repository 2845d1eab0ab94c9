"""`bt-actions run --sim-like`: a recorded run is played again, on nodes and in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from test_msgs.action import Fibonacci

from bt_actions import load_tree
from bt_actions.events import AttemptEnded, Event, RunBegan
from bt_actions.goals.policy import Outcome
from bt_actions.recording.reading import Recording
from bt_actions.recording.writing import RunWriter
from bt_actions.story.state import State
from bt_actions.testing import (
    Script,
    ScriptedServer,
    VirtualNetwork,
    VirtualRunner,
    serve_as_recorded,
)
from tests.cli.conftest import Start
from tests.cli.test_arguments import refused
from tests.support.processes import Journal

NIGHT = "examples/night/night.yaml"
FOREIGN = """\
tree: foreign
root:
  sequence: S
  children:
    - {action: Count, type: test_msgs/action/Fibonacci, server: counter, goal: {order: 3},
       timeout: 5 s, expect: len(result.sequence) > 2}
    - {action: Again, type: test_msgs/action/Fibonacci, server: counter, goal: {order: 4},
       timeout: 5 s}
    - {service: Light, type: std_srvs/srv/SetBool, server: light, request: {data: true}}
"""


def outcomes(events: Iterable[Event | State]) -> list[tuple[tuple[str, ...], Outcome]]:
    """The path of each leaf with what it said of each attempt."""
    state, found = State(), []
    for event in events:
        assert not isinstance(event, State)
        state.fold(event)
        if isinstance(event, AttemptEnded):
            found.append((state.path(event.node), event.outcome))
    return found


def test_a_night_fails_again_as_it_did(start: Start, tmp_path: Path) -> None:
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    fault = ("--fault", "move_robot:12:abort")
    run = start("run", NIGHT, "--sim", "--speed", "10", *fault, "--record", str(first))
    assert run.wait(60.0) == 1, run
    was = outcomes(Recording(first).items())
    assert was[-1] == (
        ("Shift", "Go home", "Straight home", "Home in time", "Home"),
        Outcome.ABORTED,
    )

    again = start("run", NIGHT, "--sim-like", str(first), "--speed", "10", "--record", str(second))
    assert again.wait(60.0) == 1, again
    assert outcomes(Recording(second).items()) == was
    runs = [Recording(each).state() for each in (first, second)]
    assert runs[0].simulation == "--sim --speed 10 --fault move_robot:12:abort"
    assert runs[0].began is not None
    assert runs[1].simulation == f"--sim-like {runs[0].began.run_id} --speed 10"
    assert any("13 of 13 of /gripper_control, 12 of 12 of" in line for line in again.lines), again
    assert any("feedback is played as it was recorded" in line for line in again.errors), again
    assert sum("no recorded messages on /battery_state" in line for line in again.errors) == 1, (
        again
    )

    network = VirtualNetwork()
    tree = load_tree(NIGHT)
    serve_as_recorded(network, tree, first)
    runner = VirtualRunner(tree, network)
    assert runner.run() is Status.FAILURE
    assert outcomes(runner.events) == was
    assert not [text for level, text in network.log.lines if level != "info"]


def test_servers_of_any_type_are_played_and_services_are_named(
    start: Start, tmp_path: Path
) -> None:
    path, first = tmp_path / "foreign.yaml", tmp_path / "first.mcap"
    path.write_text(FOREIGN)
    network = VirtualNetwork()
    script = Script(result=lambda goal: Fibonacci.Result(sequence=[0, 1, 1]))
    ScriptedServer(network, Fibonacci, "counter", script, faults=["counter:2:abort"])
    runner = VirtualRunner(load_tree(path), network)
    runner.run()
    write(first, runner.events)

    run = start("run", str(path), "--sim-like", str(first), "--verbose")
    assert run.wait() == 1, run
    table = [line.split()[:4] for line in run.lines if line.startswith(("Count", "Again"))]
    assert table == [
        ["Count", "/counter", "1", "SUCCEEDED"],
        ["Again", "/counter", "1", "ABORTED"],
    ], run
    assert any("it has no server for /light (SetBool)" in line for line in run.errors), run


def test_a_robot_of_the_same_name_nearby_is_not_asked(
    start: Start,
    robot: Callable[..., Journal],
    namespace: str,
    tree: Callable[..., Path],
    tmp_path: Path,
) -> None:
    path, first = tree(), tmp_path / "first.mcap"
    network = VirtualNetwork(namespace)
    ScriptedServer(network, MoveRobot, "move_robot", faults=["move_robot:1:abort"])
    runner = VirtualRunner(load_tree(path), network)
    runner.run()
    write(first, runner.events)

    nearby = robot(speed=20.0)
    run = start("run", str(path), "--sim-like", str(first), "--namespace", namespace)
    assert run.wait() == 1, run
    assert any("ABORTED: aborted by" in line for line in run.lines), run
    assert nearby.count("received") == 0


def test_a_file_that_is_no_recording_is_refused(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "first.mcap"
    path.write_bytes(b"no recording")
    run = start("run", NIGHT, "--sim-like", str(path))
    assert run.wait() == 2, run
    assert any("is no recording" in line for line in run.errors), run
    assert "Traceback" not in "\n".join(run.errors)


def test_what_names_no_run_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--sim-like: no run is recorded yet" in refused(
        capsys, "run", NIGHT, "--sim-like", "night"
    )


def write(first: Path, events: list[Event]) -> None:
    """Record events."""
    began = next(each for each in events if isinstance(each, RunBegan))
    writer = RunWriter(first, began)
    for event in events:
        writer.add(event)
    writer.close()
