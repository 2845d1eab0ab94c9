"""A runner that plays a script of events; no ROS. Stands in where only the view is under test."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.places import path_of
from bt_actions.events import Event, GoalChanged, NodeChanged, TreeFinished, TreeStarted
from bt_actions.goals.policy import End, Outcome


@dataclass
class FakeProgress:
    """As ActionBehaviour.progress() gives it."""

    state: str = "EXECUTING"
    attempt: int = 1
    attempts: int = 1
    feedback: object = None
    seconds_left: float | None = None
    deadline: str = ""


class FakeAction(Behaviour):
    """A leaf that looks like an action leaf to report and views."""

    def __init__(self, name: str, server: str = "move_robot", kind: str = "MoveRobot") -> None:
        super().__init__(name)
        self.server = server
        self.action_type = f"robot_control_interfaces/action/{kind}"
        self.shown = FakeProgress()

    def update(self) -> Status:
        raise AssertionError("a fake is never ticked")

    def progress(self) -> FakeProgress:
        return self.shown


@dataclass
class Story:
    """Makes events with a clock of their own."""

    time: float = 100.0
    step: float = 0.5

    def _next(self) -> float:
        self.time += self.step
        return self.time

    def start(self) -> TreeStarted:
        return TreeStarted(self._next())

    def node(self, node: Behaviour, status: Status, message: str = "") -> NodeChanged:
        return NodeChanged(self._next(), path_of(node), node, status, message)

    def goal(
        self,
        leaf: FakeAction,
        state: str,
        *,
        attempt: int = 1,
        visit: int = 1,
        outcome: Outcome | None = None,
        end: End | None = None,
        reason: str = "",
    ) -> GoalChanged:
        """An event of goal `attempt`; `visit` tells apart what has the same number."""
        goal_id = f"{leaf.name}-{visit}-{attempt}"
        return GoalChanged(
            self._next(),
            leaf,  # type: ignore[arg-type]  # a fake
            state,
            attempt,
            outcome,
            end,
            reason,
            goal_id,
        )

    def finish(self, status: Status) -> TreeFinished:
        return TreeFinished(self._next(), status)

    def succeed(self, leaf: FakeAction) -> list[Event]:
        """A leaf that runs and succeeds at the first attempt."""
        return [
            self.node(leaf, Status.RUNNING),
            self.goal(leaf, "SENDING"),
            self.goal(leaf, "EXECUTING"),
            self.goal(leaf, "DONE", outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED),
            self.node(leaf, Status.SUCCESS),
        ]


@dataclass
class FakeRunner:
    """Plays `before`, waits to be interrupted if `waits`, then plays `after`."""

    before: Iterable[Event] = ()
    after: Iterable[Event] = ()
    waits: bool = False
    never_drains: bool = False
    unaccounted: list[object] = field(default_factory=list)
    error: Exception | None = None
    interrupted: threading.Event = field(default_factory=threading.Event)
    abandoned: threading.Event = field(default_factory=threading.Event)
    playing: threading.Event = field(default_factory=threading.Event)
    released: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._observers: list[Callable[[Event], None]] = []

    def observe(self, callback: Callable[[Event], None]) -> None:
        self._observers.append(callback)

    def interrupt(self, *, abandon: bool = False) -> None:
        self.interrupted.set()
        if abandon:
            self.abandoned.set()

    def catch_up(self) -> None:
        pass

    def tick_to_end(self) -> None:
        self._play(self.before)
        self.playing.set()
        if self.waits:
            self.interrupted.wait()
        if self.never_drains:
            self.released.wait()
        self._play(self.after)
        if self.error is not None:
            raise self.error

    def _play(self, events: Iterable[Event]) -> None:
        for event in events:
            for observer in self._observers:
                observer(event)
