"""Trees and servers in virtual time, with the words that tests against real servers have."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Self
from unittest.mock import Mock

from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as MoveRobotAction

from bt_actions.simulation import Script, ScriptedServer, Simulation
from bt_actions.testing import VirtualNetwork, VirtualRunner
from bt_actions.testing.transport import VirtualParticipant
from tests.support.processes import Journal


class Runner(VirtualRunner):
    """Lets time pass until something is so."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.shutdown()

    def wait(self, within: float) -> Status:
        """Return the tree's status when it has ended."""
        status = self.advance(within)
        assert status is not None, f"not within {within:g} s"
        return status

    def until(self, condition: Callable[[], Any], within: float = 15.0) -> Any:
        end = self.now + within
        while not (found := condition()):
            assert self.now < end, f"not within {within:g} s"
            self.advance(0.01)
        return found


class World:
    """A network, its servers, and the trees on it."""

    def __init__(self, directory: Path) -> None:
        self.network = VirtualNetwork()
        self.servers: dict[str, ScriptedServer] = {}
        self._directory = directory

    def serve(self, *faults: str, name: str = "/move_robot", **script: Any) -> Journal:
        """Open a server; faults are written without its name.

        A goal takes as many seconds as its distance says, and is refused beyond 100.
        """
        path = self._directory / f"{len(self.servers)}.jsonl"
        self.servers[name] = ScriptedServer(
            self.network,
            MoveRobotAction,
            name,
            Script(
                duration=lambda goal: abs(goal.distance),
                feedback=lambda goal, done: MoveRobotAction.Feedback(
                    current_pose=goal.distance * done
                ),
                result=lambda goal: MoveRobotAction.Result(final_pose=goal.distance),
                refuse=lambda goal: "too far" if abs(goal.distance) > 100.0 else None,
                **script,
            ),
            faults=[f"{name}:{fault}" for fault in faults],
            journal=path,
            result_timeout=20.0,
        )
        return Journal(path, name)

    def robot(self, *faults: str) -> Simulation:
        """Open a robot that is ten times as fast."""
        return Simulation(self.network, faults=faults, speed=10.0)

    def runner(self, root: Any, **settings: Any) -> Runner:
        """Make a runner of a tree, as of a process of its own."""
        return Runner(root, self.network, **settings)

    def run(self, root: Any, within: float = 60.0) -> Any:
        """Run a tree to its end; return its root."""
        with self.runner(root) as runner:
            runner.run(timeout=within)
        return root

    def cancel_all(self, name: str = "/move_robot") -> None:
        """Ask a server, as an operator does, to cancel all its goals."""
        participant = VirtualParticipant(self.network, "operator", "/")
        operator = participant.open_transport(MoveRobotAction, name, Mock())
        for goal_id in self.servers[name].live_goals:
            operator.cancel(bytes.fromhex(goal_id))

    def close(self) -> None:
        """Close the servers."""
        for server in self.servers.values():
            server.close()
