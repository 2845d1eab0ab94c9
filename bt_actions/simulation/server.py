"""The common part of all simulated action servers: goals from request to end, faults, journal.

A subclass defines the meaning of a goal (GoalMeaning); `faults` decide which goal is struck, and
`intake`, `live_goal` and `result_faults` carry them out. The same code serves on an rclpy node and
on the virtual network (`platform`): nothing here blocks, raises into an executor, or has a thread.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any

from bt_actions.simulation.fault_plan import FaultPlan, GoalFaults
from bt_actions.simulation.faults import Fault, FaultKind
from bt_actions.simulation.goal_meaning import Motion
from bt_actions.simulation.intake import Intake
from bt_actions.simulation.journal import Event, Journal
from bt_actions.simulation.live_goal import LiveGoal, Owner
from bt_actions.simulation.platform import Platform, Request, Wire
from bt_actions.simulation.result_faults import ResultFaults
from bt_actions.simulation.stepper import Stepper
from bt_actions.utilities.plain_text import raised

RESULT_TIMEOUT = 5.0
"""Seconds for which a finished goal is remembered. rclpy's own 15 minutes make each new goal
slower."""

_ALL_GOALS = "0" * 32


class SimulatedServer(Owner):
    """An action server on `node` whose goals move in simulated time, with faults on request."""

    def __init__(
        self,
        node: Any,
        action_type: Any,
        name: str,
        *,
        stepper: Stepper | None = None,
        speed: float = 1.0,
        step_period: float = 0.1,
        faults: FaultPlan | Iterable[Fault | str] = (),
        seed: int | None = None,
        journal: Journal | str | os.PathLike[str] | None = None,
        time_limit: float | None = None,
        preempts: bool = True,
        result_timeout: float = RESULT_TIMEOUT,
        on_death: Callable[[], None] | None = None,
    ) -> None:
        """Serve `action_type` under `name`, which is expanded with the node's namespace.

        `node` is an rclpy node, or another Platform. Servers that share a `stepper` share its timer
        and its lock, its speed and step period; a server without one makes its own. `time_limit` is
        in seconds of simulated time. With `preempts` a newer goal aborts the older ones. `on_death`
        is called when the fault `die` strikes, before the server is destroyed.

        Raises FaultError when a fault fits no server of this name.
        """
        self._platform = stepper.platform if stepper else platform_of(node)
        self.action_type = action_type
        self.name = self._platform.expand(name)
        if isinstance(faults, FaultPlan):
            self.faults = faults
        else:
            self.faults = FaultPlan.of(faults, seed)
            self.faults.check([self.name])
        self._log = self._platform.log
        self._owns_stepper = stepper is None
        self._owns_journal = not isinstance(journal, Journal)
        if isinstance(journal, Journal):
            self.journal = journal
        else:
            self.journal = Journal(journal, clock=self._platform.now, on_error=self._log.error)
        self.stepper = stepper or Stepper(self._platform, speed=speed, step_period=step_period)
        self._time_limit = time_limit
        self._preempts = preempts
        self._result_timeout = result_timeout
        self._on_death = on_death
        self._intake = Intake(self.name, self.strike, record=self.record, warn=self._log.warning)
        self._live: dict[str, LiveGoal] = {}
        self._results = ResultFaults(self.stepper, self._answer_result)
        self._closed = False
        self._wire: Wire | None = None
        try:
            self.open()
        except BaseException:
            self.close()
            raise

    def __repr__(self) -> str:
        state = f"{len(self._live)} live" if self._wire else "down"
        return f"<{type(self).__name__} {self.name} {state}, {self._intake.count} goals>"

    @property
    def is_open(self) -> bool:
        """Whether the server is there: not dead, not closed."""
        return self._wire is not None

    @property
    def live_goals(self) -> list[str]:
        """The ids (hex) of the goals that are executing, oldest first."""
        with self.stepper.lock:
            return list(self._live)

    def open(self) -> None:
        """Bring the server up, again after `die`.

        Do nothing when it is there already, or closed.
        """
        with self.stepper.lock:
            if self._wire is not None or self._closed:
                return
            self._wire = self._platform.serve(
                self.action_type, self.name, self, self._result_timeout
            )
            self.record("", Event.OPENED)

    def die(self, reason: str = "died") -> None:
        """Destroy the server, with all goals and without a word to the clients.

        `open` brings it back.
        """
        with self.stepper.lock:
            if self._on_death is not None:
                self._on_death()
            self.abandon(reason)

    def restart(self, seconds: float) -> None:
        """Destroy the server for so many wall seconds. The process lives on."""
        with self.stepper.lock:
            self.abandon("restart")
            self.stepper.call_at(self.stepper.now() + seconds, lambda now: self.open())

    def close(self) -> None:
        """Destroy the server for good. Safe while the executor spins and after it has stopped."""
        with self.stepper.lock:
            if self._closed:
                return
            self._closed = True
            self.abandon("closed")
            if self._owns_stepper:
                self.stepper.close()
            if self._owns_journal:
                self.journal.close()

    def abandon(self, reason: str) -> None:
        """Leave all goals where they are, and destroy the server."""
        with self.stepper.lock:
            self.record_death(reason)
            for live in self._live.values():
                self.stepper.stop(live.step)
                live.abandon()
            self._live.clear()
            self._intake.clear()
            self._results.clear()
            wire, self._wire = self._wire, None
            if wire is not None:
                wire.destroy()

    def record_death(self, reason: str) -> None:
        """Write into the journal that the server and its goals end here."""
        with self.stepper.lock:
            for live in self._live.values():
                state = self.state(live.motion)
                self.record(live.goal_id, Event.DIED, **state, reason=reason)
            if self._wire is not None:
                self.record("", Event.CLOSED, reason=reason)

    def strike(self, goal: Any, number: int) -> GoalFaults:
        """Return the faults of a requested goal, the server's `number`-th."""
        return self.faults.strike(self.name, number)

    def record(self, goal_id: str, event: Event, **more: object) -> None:
        self.journal.write(self.name, goal_id, event, **more)

    def broken(self, goal_id: str, reason: str) -> None:
        self._log.warning(f"{self.name}: goal {goal_id[:8]} aborted: {reason}")

    def ended(self, goal: LiveGoal, result: Any) -> None:
        self.stepper.stop(goal.step)
        self._live.pop(goal.goal_id, None)
        if self._wire is not None:
            self._wire.finish(goal.goal_id, result)
        self._results.ended(goal.goal_id, self.stepper.now(), self._result_timeout)

    # Requests, as the wire brings them.

    def on_request(self, request: Request) -> bool:
        with self.stepper.lock:
            if request.kind == "goal":
                return self._on_goal_request(request)
            if request.kind == "cancel":
                return self._on_cancel_request(request.goal_id)
            return self._results.on_request(request.goal_id, request)

    def on_answered(self, request: Request) -> None:
        with self.stepper.lock:
            if request.kind == "goal":
                not_started = self._intake.close_request(request.goal, request.goal_id)
                if not_started and self._wire and self._wire.knows(request.goal_id):
                    # The client went away before its answer; rclpy then starts nothing.
                    self.start(request.goal_id, request.goal)
            elif request.kind == "cancel":
                for live in list(self._live.values()):
                    live.poll(self.stepper.now())
                    if live.due is not None:
                        self.stepper.call_at(live.due, live.poll)

    def _on_goal_request(self, taken: Request) -> bool:
        wire = self._wire
        if wire is None:
            return False
        request = self._intake.receive(taken.goal, taken.goal_id)
        if request.faults:
            self._log.info(f"{self.name}: goal {request.number} meets {request.faults}")
        if request.faults.dies("accept"):
            self.die("fault: die=accept")
        if request.is_lost:
            return False
        silent = FaultKind.DROP_ACCEPT in request.faults
        if not silent and FaultKind.DELAY_ACCEPT not in request.faults:
            return True
        due = self.stepper.now() + (request.faults.number(FaultKind.DELAY_ACCEPT) or 0.0)
        self.stepper.call_at(due, lambda now: wire.answer_soon(taken, silent=silent))
        return False

    def _on_cancel_request(self, goal_id: str) -> bool:
        asked = list(self._live) if goal_id == _ALL_GOALS else [goal_id]
        for each in asked:
            self.record(each, Event.CANCEL_REQUESTED)
        faults = [self._live[each].faults for each in asked if each in self._live]
        if any(of_goal.dies("cancel") for of_goal in faults):
            self.die("fault: die=cancel")
            return False
        return not any(FaultKind.DROP_CANCEL in of_goal for of_goal in faults)

    def _answer_result(self, request: Request) -> None:
        if self._wire is not None:
            self._wire.answer_soon(request)

    def decide(self, goal: Any) -> bool:
        with self.stepper.lock:
            return self._intake.decide(goal, self.refusal)

    def start(self, goal_id: str, goal: Any) -> None:
        with self.stepper.lock:
            # The journal shows the acceptance before the abort of an older goal, so that two goals
            # at once are seen.
            wire, request = self._wire, self._intake.start(goal_id)
            if wire is None or request is None:
                return
            if self._preempts:
                for older in list(self._live.values()):
                    older.replace()
            motion, problem = self._begin(goal)
            live = self._live[goal_id] = LiveGoal(
                self,
                goal_id,
                wire,
                motion,
                request.faults,
                now=self.stepper.now(),
                step_period=self.stepper.step_period,
                time_limit=self._time_limit,
            )
            self._results.expect(goal_id, request.faults)
            wire.start(goal_id)
            if problem:
                self.broken(goal_id, problem)
                live.give_up(problem)
            else:
                self.stepper.start(live.step)

    def _begin(self, goal: Any) -> tuple[Motion, str]:
        try:
            return self.begin(goal), ""
        except Exception as error:  # noqa: BLE001 - rclpy would leave the goal live for ever
            return _Nowhere(), f"it could not begin: {raised(error)}"

    def cancel(self, goal_id: str) -> bool:
        with self.stepper.lock:
            live = self._live.get(goal_id)
            return live is not None and live.cancel(self.stepper.now())


class _Nowhere:
    """The motion of a goal that could not begin."""

    progress = 0.0
    done = False

    def step(self, share: float) -> None:
        pass


def platform_of(node: Any) -> Platform:
    """Return the platform of an rclpy node; a platform is returned as it is."""
    if hasattr(node, "serve"):
        platform: Platform = node
        return platform
    from bt_actions.simulation.ros.platform import NodePlatform

    return NodePlatform(node)
