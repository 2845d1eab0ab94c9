"""A process of action servers that does what it is told, line by line: ``python -m``.

Each line on stdin is a JSON object; each is answered by one on stdout, when it has been done. It
ends when stdin is closed, so that no test leaves one behind. The servers' journals are the judges
of most tests; nothing is judged here.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from robot_control_interfaces.action import MoveRobot

from bt_actions.simulation import Script, ScriptedServer, Simulation
from bt_actions.simulation.journal import Event

TOO_FAR = 100.0


def _refuse(goal: MoveRobot.Goal) -> str | None:
    return "too far" if abs(goal.distance) > TOO_FAR else None


def _nothing() -> None:
    pass


class TellsLate(ScriptedServer):
    """Executes what it accepts, and says so many seconds later that it has accepted it.

    For goals that are struck by ``drop_accept``, which loses the answer otherwise. Its journal says
    which distance was asked for, too.
    """

    tells_after: float | None = None
    _asked = 0.0

    def record(self, goal_id: str, event: Event, **more: object) -> None:
        if event is Event.RECEIVED:
            more["distance"] = self._asked
        super().record(goal_id, event, **more)

    def on_request(self, request: Any) -> bool:
        if request.kind == "goal":
            self._asked = request.goal.distance
        is_answered = super().on_request(request)
        if request.kind == "goal" and not is_answered and self.tells_after is not None:
            due = self.stepper.now() + self.tells_after
            self.stepper.call_at(due, lambda _: self._tell(request.header))
        return is_answered

    def _tell(self, header: Any) -> None:
        wire: Any = self._wire
        answer = self.action_type.Impl.SendGoalService.Response(accepted=True)
        wire._handle.send_goal_response(header, answer)


class Serving:
    """The servers of this process, by the name that they were opened with."""

    def __init__(self) -> None:
        self.node = Node(f"serving_{os.getpid()}")
        self.servers: dict[str, ScriptedServer | Simulation] = {}

    def open(
        self,
        name: str,
        journal: str,
        faults: list[str],
        step_period: float = 0.05,
        thinks: float = 0.0,
        busy: float = 0.0,
        tells_after: float | None = None,
        remembers: float = 20.0,
        **script: Any,
    ) -> None:
        """Serve MoveRobot under `name`: a goal takes as many seconds as its distance says.

        It answers nobody for `thinks` seconds before it accepts one, and for `busy` s after that;
        for `tells_after`, see TellsLate.
        """

        def refusal(goal: MoveRobot.Goal) -> str | None:
            time.sleep(thinks)
            return _refuse(goal)

        def duration(goal: MoveRobot.Goal) -> float:
            time.sleep(busy)
            return abs(float(goal.distance))

        self.servers[name] = server = TellsLate(
            self.node,
            MoveRobot,
            name,
            Script(
                duration=duration,
                feedback=lambda goal, done: MoveRobot.Feedback(current_pose=goal.distance * done),
                result=lambda goal: MoveRobot.Result(final_pose=goal.distance),
                refuse=refusal,
                **script,
            ),
            faults=faults,
            journal=journal,
            step_period=step_period,
            on_death=lambda: os.kill(os.getpid(), signal.SIGKILL),
            result_timeout=remembers,
        )
        server.tells_after = tells_after

    def robot(
        self, name: str, journal: str, faults: list[str], speed: float, battery: bool = True
    ) -> None:
        """Serve a simulated robot in the namespace `name`; it may have a battery that is silent."""
        robot = Simulation(
            self.node, namespaces=(name,), speed=speed, faults=faults, journal=journal
        )
        if not battery:
            robot._cells[name].battery.publish = lambda _seconds: None  # type: ignore[method-assign]
        self.servers[name] = robot

    def close(self, name: str) -> None:
        """Serve it no more."""
        self.servers.pop(name).close()

    def thaw(self) -> None:
        """Go on, after `freeze`."""

    def cancel_all(self, name: str) -> None:
        """Ask the server `name`, as an operator does, to cancel all its goals."""
        from action_msgs.srv import CancelGoal

        client = self.node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        if not client.wait_for_service(timeout_sec=5.0):
            raise RuntimeError(f"no server {name}")
        client.call_async(CancelGoal.Request())


def main() -> None:
    """Serve until stdin is closed."""
    rclpy.init()
    orders: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    executor = SingleThreadedExecutor()
    serving = Serving()
    executor.add_node(serving.node)

    def listen() -> None:
        for line in sys.stdin:
            orders.put(json.loads(line))
            executor.create_task(_nothing)  # spin_once returns for a task, not for wake()
        orders.put({"order": "end"})
        executor.create_task(_nothing)

    threading.Thread(target=listen, daemon=True).start()
    print(json.dumps({"ready": os.getpid()}), flush=True)
    try:
        while True:
            executor.spin_once()
            while not orders.empty():
                order = orders.get()
                what = order.pop("order")
                if what == "freeze":
                    print(json.dumps({"done": what}), flush=True)
                    order = orders.get()  # "thaw", and nothing is taken or answered until then
                    what = order.pop("order")
                if what == "end":
                    return
                try:
                    getattr(serving, what)(**order)
                    answer = {"done": what}
                except Exception as error:  # noqa: BLE001 - the test wants to read it
                    answer = {"failed": f"{what}: {error!r}"}
                print(json.dumps(answer), flush=True)
    except (ExternalShutdownException, KeyboardInterrupt):
        return
    finally:
        for name in list(serving.servers):
            serving.close(name)
        serving.node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
