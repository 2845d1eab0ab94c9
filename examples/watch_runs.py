"""Watch the runs of a node over ROS: a line for each event, and why a run that has ended failed.

While `bt-actions run` or `bt-actions serve` runs in another terminal:
    python examples/watch_runs.py /bt_actions_serve
"""

import contextlib
import sys

import rclpy
from bt_actions_interfaces.msg import RunEvent, RunState, RunStates
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.events import TreeFinished, from_line
from bt_actions.story.keeping import from_json
from bt_actions.story.state import State
from bt_actions.story.why import why


class Watcher:
    """Knows how all runs of a node stand, from whenever it began to watch."""

    def __init__(self, node: Node, watched: str) -> None:
        """`watched` is the full name of the node whose runs these are."""
        self.runs: dict[str, State] = {}
        """By the run's id."""
        self._numbers: dict[str, int] = {}
        self._ahead: dict[str, list[RunEvent]] = {}
        """Events that a state has to come before: one before them is missing."""
        self._states: dict[str, RunState] = {}
        """The latest of each run: it may come before the events that it stands behind."""
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(RunEvent, f"{watched}/events", self.event, QoSProfile(depth=1000))
        node.create_subscription(RunStates, f"{watched}/tree", self.states, latched)

    def event(self, message: RunEvent) -> None:
        """Take in an event that follows the one before, and keep one that does not."""
        run = bytes(message.run_id).hex()
        known = self._numbers.get(run, 0)
        if message.number > known + 1:
            self._ahead.setdefault(run, []).append(message)
            self.catch_up(run)
        elif message.number == known + 1:
            self._numbers[run] = message.number
            state = self.runs.setdefault(run, State())
            if message.data:  # else its values are for nobody
                state.fold(from_line(message.data))
            self.follows(run, message)

    def states(self, message: RunStates) -> None:
        """Take in how those runs stand of which events are missing, and what has happened since."""
        for each in message.runs:
            run = bytes(each.run_id).hex()
            self._states[run] = each
            self.catch_up(run)

    def catch_up(self, run: str) -> None:
        """Go on from the latest state where that stands behind events that are missing."""
        known, state = self._numbers.get(run, 0), self._states.get(run)
        if state is not None and state.number > known and (run in self._ahead or not known):
            self._numbers[run], self.runs[run] = state.number, from_json(state.data)
            for waiting in self._ahead.pop(run, []):
                self.event(waiting)

    def follows(self, run: str, message: RunEvent) -> None:
        """Tell of an event that has been taken in."""
        state = self.runs[run]
        node = state.nodes.get(message.node)
        print(f"{run[:6]} {message.number:5} {message.kind}", node.node.name if node else "")
        if message.kind == TreeFinished.__name__:
            print(*why(state), sep="\n")


def main(watched: str) -> None:
    """Watch until Ctrl-C."""
    rclpy.init()
    node = rclpy.create_node("watch_runs")
    Watcher(node, watched)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main(*sys.argv[1:])
