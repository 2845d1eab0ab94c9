"""Nav2's servers in a process of their own, which do what a script says: ``python -m``.

Each line on stdin is a JSON object, from the name of a server to what the server does from now on:
`seconds` that a goal takes, `fails`, the error codes of the goals that come next (0: succeeds),
`poses`, how many the paths have that are planned next, and `error`, how far left of its path the
robot says that it is.
Those that a line does not name do as they did in the beginning. Each line is answered on stdout,
and the process ends when stdin is closed. The way that is to be followed takes its time in all,
however often the path is replaced, as with a robot that goes on while a new path comes.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

import rclpy
from nav2_msgs.action import (
    BackUp,
    ComputePathThroughPoses,
    ComputePathToPose,
    DockRobot,
    DriveOnHeading,
    FollowPath,
    NavigateToPose,
    Spin,
    UndockRobot,
)
from nav2_msgs.srv import ClearEntireCostmap, IsPathValid
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor

from bt_actions.messages.conversion import to_plain
from bt_actions.simulation import Script, ScriptedServer
from bt_actions.simulation.goal_meaning import Finish
from bt_actions.simulation.journal import Event, Journal

ACTIONS = {
    "compute_path_to_pose": (ComputePathToPose, 0.1),
    "compute_path_through_poses": (ComputePathThroughPoses, 0.1),
    "follow_path": (FollowPath, 0.5),
    "spin": (Spin, 0.1),
    "backup": (BackUp, 0.1),
    "drive_on_heading": (DriveOnHeading, 0.1),
    "navigate_to_pose": (NavigateToPose, 0.1),
    "dock_robot": (DockRobot, 0.1),
    "undock_robot": (UndockRobot, 0.1),
}
"""The actions, and how many seconds a goal takes unless a script says otherwise."""
CLEARING = [f"{each}_costmap/clear_entirely_{each}_costmap" for each in ("local", "global")]
VALIDITY = "is_path_valid"


class Scripted(ScriptedServer):
    """Preempts, as the servers of Nav2 do; a goal that fails has its error code in the result."""

    seconds: float
    fails: list[int]
    poses: list[int]
    error: float
    arrives: float | None = None

    def begin(self, goal: Any) -> Any:
        code = self.fails.pop(0) if self.fails else 0
        if self.arrives is None:
            self.arrives = self.stepper.now() + self.seconds
        left = self.arrives - self.stepper.now()
        self.script = Script(duration=0.1 if code else max(0.0, left), preempts=True)
        motion = super().begin(goal)
        motion.code = code
        return motion

    def verdict(self, motion: Any) -> tuple[Finish, str]:
        return (Finish.FAULT, f"error {motion.code}") if motion.code else super().verdict(motion)

    def result(self, motion: Any, finish: Finish, reason: str) -> Any:
        if finish is not Finish.REPLACED:
            self.arrives = None
        result = self.action_type.Result(error_code=motion.code)
        if hasattr(result, "path"):  # which differs from those before
            goal = motion.goal
            result.path.header.frame_id = f"path {self._intake.count}"
            poses = goal.goals.goals if hasattr(goal, "goals") else [goal.goal]
            result.path.poses = poses * (self.poses.pop(0) if self.poses else 1)
        return result

    def feedback(self, motion: Any) -> Any:
        made = self.action_type.Feedback()
        if hasattr(made, "tracking_feedback"):
            made.tracking_feedback.position_tracking_error = self.error
        return made

    def on_request(self, request: Any) -> bool:
        if request.kind == "goal":
            self._goal = to_plain(request.goal)
        return super().on_request(request)

    def record(self, goal_id: str, event: Event, **more: object) -> None:
        if event is Event.RECEIVED:
            more["fields"] = self._goal
        super().record(goal_id, event, **more)


class Servers:
    """All servers of Nav2 that the trees need, on one node."""

    def __init__(self, space: str, path: Path) -> None:
        self.node = rclpy.create_node("nav2", namespace=space)
        self.journal = Journal(path)
        self.actions = {
            name: Scripted(
                self.node, kind, name, Script(preempts=True), step_period=0.02,
                faults=[f"{name}:*:delay_cancel=0.2"], journal=self.journal,
            )
            for name, (kind, _) in ACTIONS.items()
        }  # fmt: skip
        self.script: dict[str, Any] = {}
        for name in (*CLEARING, VALIDITY):
            self._serve(name, IsPathValid if name == VALIDITY else ClearEntireCostmap)
        self.obey({})

    def _serve(self, name: str, kind: Any) -> None:
        def call(request: Any, response: Any) -> Any:
            self.journal.write(name, "", Event.RECEIVED)
            script = self.script.get(name, {})
            time.sleep(script.get("seconds", 0.0))
            if name == VALIDITY:
                fails = script.get("fails", [])
                response.is_valid = not ((fails.pop(0) if fails else 0) or not request.path.poses)
            return response

        group = ReentrantCallbackGroup()
        self.node.create_service(kind, name, call, callback_group=group)

    def obey(self, script: dict[str, Any]) -> None:
        """Do from now on what a script says."""
        self.script = script
        for name, server in self.actions.items():
            said = script.get(name, {})
            server.seconds = said.get("seconds", ACTIONS[name][1])
            server.fails, server.arrives = said.get("fails", []), None
            server.poses, server.error = said.get("poses", []), said.get("error", 0.0)


def main() -> None:
    """Serve until stdin is closed."""
    rclpy.init()
    servers = Servers(sys.argv[1], Path(sys.argv[2]))
    executor = MultiThreadedExecutor(4)
    executor.add_node(servers.node)
    threading.Thread(target=executor.spin, daemon=True).start()
    print("ready", flush=True)
    for line in sys.stdin:
        servers.obey(json.loads(line))
        print("done", flush=True)
    executor.shutdown()
    for server in servers.actions.values():
        server.close()
    servers.node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
