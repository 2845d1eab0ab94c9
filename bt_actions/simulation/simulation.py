"""Simulated robots on one node: one for each namespace, with one timer and no thread.

A simulation neither spins nor owns the node. A fault that kills a server destroys that server where
the process is shared with a tree, and kills the process where it is the simulation's own.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

from bt_actions.simulation.fault_plan import FaultPlan
from bt_actions.simulation.faults import Fault
from bt_actions.simulation.journal import Journal
from bt_actions.simulation.robot_cell import RobotCell
from bt_actions.simulation.server import RESULT_TIMEOUT, SimulatedServer, platform_of
from bt_actions.simulation.stepper import Stepper
from bt_actions.simulation.world import World, WorldEvent
from bt_actions.utilities.plain_text import raised


class Simulation:
    """Robots that serve `move_robot` and `gripper_control` and carry a part between stations."""

    def __init__(
        self,
        node: Any,
        *,
        namespaces: Sequence[str] = ("",),
        speed: float = 1.0,
        step_period: float = 0.1,
        faults: Iterable[Fault | str] = (),
        seed: int | None = None,
        journal: str | os.PathLike[str] | None = None,
        in_process: bool = True,
        result_timeout: float = RESULT_TIMEOUT,
        on_event: Callable[[str, WorldEvent], None] | None = None,
    ) -> None:
        """Serve one robot for each of `namespaces`; "" is the node's own.

        `node` is an rclpy node, or another Platform. `speed` is simulated seconds in one wall
        second, `step_period` in simulated seconds. Without a `seed` one is chosen; it is logged
        when a fault depends on it. `in_process` False means that the process is the simulation's
        own, to be killed by the fault `die`. `on_event` gets the events of the parts, with the
        namespace, on the executor's thread; after an error it gets no more.

        Raises FaultError for a fault that is written wrong or fits no server, ValueError for any
        other bad setting, OSError for a journal that cannot be opened.
        """
        names = tuple(dict.fromkeys(namespaces))
        if not names:
            raise ValueError("a simulation needs at least one namespace")
        platform = platform_of(node)
        self._faults = FaultPlan.of(faults, seed)
        self._on_event: Callable[[str, WorldEvent], None] | None = on_event
        self._log = platform.log
        self._journal = Journal(journal, clock=platform.now, on_error=self._log.error)
        self._cells: dict[str, RobotCell] = {}
        self._speed = speed
        self._stepper = Stepper(platform, speed=speed, step_period=step_period)
        try:
            for namespace in names:
                self._cells[namespace] = RobotCell(
                    self._stepper,
                    namespace,
                    on_event=partial(self._tell, namespace),
                    faults=self._faults,
                    journal=self._journal,
                    result_timeout=result_timeout,
                    on_death=None if in_process else self._kill_process,
                )
            self._faults.check(server.name for server in self.servers)
        except BaseException:
            self.close()
            raise
        if self._faults.uses_chance:
            self._log.info(f"simulation: faults are drawn with seed {self.seed}")

    def __repr__(self) -> str:
        return f"<Simulation {len(self._cells)} robots, speed {self._speed:g}>"

    @property
    def seed(self) -> int:
        """The seed of the faults' dice: the same seed, the same faults."""
        return self._faults.seed

    @property
    def servers(self) -> list[SimulatedServer]:
        """All action servers."""
        return [server for cell in self._cells.values() for server in cell.servers]

    def world(self, namespace: str = "") -> World:
        """Return the robot, gripper and part of a namespace, as it was given.

        Raises KeyError for a namespace that is not simulated.
        """
        return self._cells[namespace].world

    def describe(self) -> str:
        """Say where the part is, in one sentence for each robot."""
        with self._stepper.lock:
            sentences = [(cell.namespace, cell.world.describe()) for cell in self._cells.values()]
        if len(sentences) == 1:
            return sentences[0][1]
        return "\n".join(f"{namespace}: {sentence}" for namespace, sentence in sentences)

    def close(self) -> None:
        """Destroy servers, timer and topics; the node stays. Goals get no answer any more.

        Safe while the executor spins and, better, after it has stopped; before `destroy_node`.
        """
        self._stepper.close()
        for cell in self._cells.values():
            cell.close()
        self._journal.close()

    def _tell(self, namespace: str, event: WorldEvent) -> None:
        if self._on_event is None:
            return
        try:
            self._on_event(namespace, event)
        except Exception as error:  # noqa: BLE001 - a faulty listener must not end a goal
            self._on_event = None
            self._log.error(f"simulation: on_event raised {raised(error)} and is told no more")

    def _kill_process(self) -> None:
        for server in self.servers:
            server.record_death("the process was killed")
        os.kill(os.getpid(), signal.SIGKILL)
