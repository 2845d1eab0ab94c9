"""One run with all its parts: runner, simulation, signals, view, and the order of closing.

The order: the tree ends and its goals are drained (runner), the simulated servers close, then node
and context. The tree's thread closes, so that the main thread can still hear a signal to leave.
"""

from __future__ import annotations

import contextlib
import json
import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from py_trees.behaviour import Behaviour

from bt_actions.cli.driving.drive import Drive, Judge
from bt_actions.cli.driving.signals import Signals
from bt_actions.cli.driving.simulated import Wanted, remark, wanted
from bt_actions.cli.exits import BadInput, Exit, importing_ros, leave, starting_ros
from bt_actions.cli.streams.patient_file import gap_text
from bt_actions.cli.streams.patient_output import PatientOutput
from bt_actions.cli.streams.results import results
from bt_actions.cli.streams.writing import note, terminal
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.lines import LineView
from bt_actions.cli.views.view import View
from bt_actions.running.shown import ShownRun
from bt_actions.story.state import State

if TYPE_CHECKING:
    from bt_actions.recording.recorder import Recorder
    from bt_actions.ros.naming import Outlook
    from bt_actions.running.runner import TreeRunner
    from bt_actions.simulation import RecordedServers, Simulation
    from bt_actions.simulation.faults import Fault
    from bt_actions.simulation.world import Part

Json = TypeVar("Json", bound=JsonView)
PART_TOLERANCE = 0.05
"""Metres between the part and the place of --check-part that still count as there: the size of a
simulated station.
"""


@dataclass(frozen=True, slots=True)
class SimulationWish:
    """The wish behind --sim or --sim-like and their companions."""

    speed: float = 1.0
    faults: Sequence[Fault] = ()
    seed: int | None = None
    like: Path | None = None
    """The recorded run whose servers are played; None for simulated robots."""


class Session:
    """The parts of one run, from construction to `__exit__`; main thread only."""

    def __init__(
        self,
        root: Behaviour,
        *,
        executor: str = "multi",
        namespace: str = "",
        simulation: SimulationWish | None = None,
        name: str = "",
        outlook: Outlook | None = None,
        recorder: Recorder | None = None,
        publish_values: bool | None = None,
    ) -> None:
        """Make the node, called `name`, in `outlook`, which the session closes.

        `recorder` records the run. With `publish_values` given, the node has the run's topics.

        Raises BadInput where ROS is missing or cannot start, or a fault fits no server.
        """
        with importing_ros():
            import bt_actions.ros.spinning  # noqa: F401 - the runner imports it late
        from bt_actions.running.runner import TreeRunner as Runner

        self.state = State()
        self._recorder = recorder
        with starting_ros():
            self._runner = Runner(
                root,
                executor=executor,
                namespace=namespace,
                name=name,
                context=outlook and outlook.context,
            )
        if outlook is not None:
            outlook.hand_over()
        self._shown = ShownRun(self._runner, root)
        if publish_values is not None and simulation is None:  # where nobody could listen
            from bt_actions.ros.run_topics import RunTopics

            topics = RunTopics(self._runner.node, values=publish_values)
            topics.follow(self._runner.stream)
            self._runner.on_close(topics.close)
        self._output = PatientOutput()
        self._simulator = None
        if simulation is not None:
            robots = wanted(root, self._runner.node.get_namespace().rstrip("/"))
            if said := remark(robots, recorded=simulation.like is not None):
                note(f"bt-actions: {said}")
            try:
                self._simulator = _Simulator(self._runner, root, robots, simulation)
                self._runner.where["simulation"] = self._simulator.options
            except BaseException:
                self._runner.shutdown()
                raise

    def __enter__(self) -> Self:
        logging.getLogger("bt_actions").addFilter(_is_news)
        self._output.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._runner.shutdown()
        finally:
            self._output.__exit__()
            logging.getLogger("bt_actions").removeFilter(_is_news)

    def view(self, *, as_json: bool = False, plain: bool = False, verbose: bool = False) -> View:
        """Return the view for standard output: lines if `plain`; `verbose` adds lines."""
        if as_json:
            return self.json_view(JsonView)
        if not plain and (console := terminal()) is not None:
            from bt_actions.cli.views.live import LiveView

            return LiveView(self.state, console)
        return LineView(self.state, sys.stdout, verbose=verbose)

    def json_view(self, kind: type[Json]) -> Json:
        """Return a view for programs, which hears of lines lost to a slow reader."""
        self._output.tell_gaps(_gap_object)
        return kind(self.state, results())

    def run(
        self,
        view: View,
        *,
        timeout: float | None = None,
        part_at: float | None = None,
        judge: Judge = lambda code: (code, ""),
    ) -> Exit:
        """Run to the end, show it all, return the exit code; an abandoned run never returns."""
        try:
            if view.fileno < 0:  # other views read standard error themselves
                self._output.catch_stderr()
            if self._recorder is not None:
                self._recorder.record(self._runner.stream, self._runner.ticks_since)
            with Signals() as signals:
                drive = Drive(
                    self._runner,
                    self._tick_to_end,
                    self.state,
                    view,
                    signals,
                    timeout=timeout,
                    output=self._output,
                )
                drive.run()
                code = drive.finish(*self._world(part_at), judge)
                self._close_recorder()
                if drive.abandoned:
                    self._shown.close(left=True)
                    leave(code)
                signals.settle(code)
        finally:
            self._close_recorder()
            with contextlib.suppress(OSError):  # the terminal may be gone
                view.close()
        return code

    # Within

    def _close_recorder(self) -> None:
        if self._recorder is not None:
            self._recorder.close()

    def _tick_to_end(self) -> None:
        """Run the tree, drain its goals, and close servers, node and context."""
        try:
            self._runner.run()
        finally:
            self._runner.shutdown()

    def _world(self, part_at: float | None) -> tuple[str, str]:
        """Return the simulated world in words, and what is wrong with it."""
        if self._simulator is None or not self._simulator.said:
            return "", ""
        wrong = [
            namespace
            for namespace, part in self._simulator.parts.items()
            if part_at is not None
            and (part.held_by is not None or abs(part.position - part_at) > PART_TOLERANCE)
        ]
        if not wrong:
            return self._simulator.said, ""
        which = "The part" if len(self._simulator.parts) == 1 else f"The part of {', '.join(wrong)}"
        complaint = f"{which} should lie at {part_at:.2f} m (--check-part)."
        return self._simulator.said, complaint


class _Simulator:
    """Simulated servers on a node of their own, in the executor of the tree's node."""

    def __init__(
        self, runner: TreeRunner, root: Behaviour, robots: Wanted, wish: SimulationWish
    ) -> None:
        """Open the servers before anything spins.

        Raises BadInput for a fault that fits no server, or a run that cannot be read.
        """
        from bt_actions.ros.spinning import node_beside
        from bt_actions.simulation import FaultError

        self._namespaces = robots.namespaces
        self._node = node_beside(runner.node, "simulation")
        self.parts: dict[str, Part] = {}
        """The parts by namespace, as the run's end left them; empty before."""
        self.said = ""
        self._simulation: Simulation | RecordedServers | None = None
        runner.on_close(self._close)
        try:
            self._simulation, what = self._serve(root, wish)
        except FaultError as error:
            raise BadInput(f"--fault {error}") from error
        faults = [f"--fault {each}" for each in wish.faults]
        by_chance = any(each.probability < 1.0 for each in wish.faults)
        seed = [f"--seed {self._simulation.seed}"] if by_chance else []
        self.options = " ".join([what, f"--speed {wish.speed:g}", *faults, *seed])
        """The stand-in for the world, in the words of the command line."""
        runner.executor.add_node(self._node)

    def _serve(
        self, root: Behaviour, wish: SimulationWish
    ) -> tuple[Simulation | RecordedServers, str]:
        """Return the servers, and the option that asks for them."""
        settings: dict[str, Any] = {"speed": wish.speed, "faults": wish.faults, "seed": wish.seed}
        if wish.like is None:
            from bt_actions.simulation import Simulation

            return Simulation(self._node, namespaces=self._namespaces, **settings), "--sim"
        from bt_actions.recording.reading import RecordingError
        from bt_actions.testing import serve_as_recorded

        try:
            servers = serve_as_recorded(self._node, root, wish.like, **settings)
        except RecordingError as error:
            raise BadInput(f"--sim-like {error}") from error
        assert servers.run.began is not None
        for said in servers.remarks:
            note(f"bt-actions: --sim-like: {said}")
        return servers, f"--sim-like {servers.run.began.run_id}"

    def _close(self) -> None:
        """Take note of the world, then destroy it."""
        simulation = self._simulation
        if simulation is not None:
            if hasattr(simulation, "world"):
                self.parts = {name: simulation.world(name).part for name in self._namespaces}
            self.said = simulation.describe()
            simulation.close()
        self._node.destroy_node()


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether a log line is news to the view, which lists open goals itself at the end."""
    return "accounted for" not in record.getMessage()


def _gap_object(lines: int) -> str:
    return json.dumps({"event": "note", "text": gap_text(lines).strip()}) + "\n"
