"""What all simulated action servers share: goals from request to end, their faults, their journal.

A subclass says what a goal means (GoalMeaning); what may go wrong is decided by `faults`, and how,
by `intake`, `execution` and `result_faults`. No callback blocks, none raises into the executor, and
no goal has a thread of its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from rclpy.action.server import CancelResponse, GoalResponse, ServerGoalHandle
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node

from bt_actions.simulation.execution import Execution, Motion
from bt_actions.simulation.fault_plan import FaultPlan
from bt_actions.simulation.faults import Fault, FaultKind
from bt_actions.simulation.goal_meaning import GoalMeaning
from bt_actions.simulation.intake import Fate, Intake
from bt_actions.simulation.journal import Event, Journal
from bt_actions.simulation.live_goal import LiveGoal
from bt_actions.simulation.result_faults import ResultFaults
from bt_actions.simulation.stepper import Stepper
from bt_actions.simulation.wire import InterceptedActionServer, Taken
from bt_actions.utilities.plain_text import raised

RESULT_TIMEOUT = 5.0
"""How long a finished goal is remembered, s. rclpy's own 15 minutes make each new goal slower."""

_ALL_GOALS = "0" * 32


class SimulatedServer(GoalMeaning):
    """An action server on `node` whose goals move in simulated time, with faults on request."""

    def __init__(
        self,
        node: Node,
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

        Servers that share a `stepper` share its timer and its lock, its speed and step period; a
        server without one makes its own. `time_limit` is in seconds of simulated time. With
        `preempts` a newer goal aborts the older ones. `on_death` is called when the fault `die`
        strikes, before the server is destroyed; without it, that is all that happens.

        Raises FaultError when a fault fits no server of this name.
        """
        self.node = node
        self.action_type = action_type
        self.name = expand_topic_name(name, node.get_name(), node.get_namespace())
        if isinstance(faults, FaultPlan):
            self.faults = faults
        else:
            self.faults = FaultPlan.of(faults, seed)
            self.faults.check([self.name])
        self._log = node.get_logger()
        self._owns_stepper = stepper is None
        self._owns_journal = not isinstance(journal, Journal)
        if isinstance(journal, Journal):
            self.journal = journal
        else:
            self.journal = Journal(journal, on_error=self._log.error)
        self.stepper = stepper or Stepper(node, speed=speed, step_period=step_period)
        self._time_limit = time_limit
        self._preempts = preempts
        self._result_timeout = result_timeout
        self._on_death = on_death
        self._intake = Intake(self.name, self.faults, record=self.record, warn=self._log.warning)
        self._live: dict[str, LiveGoal] = {}
        self._results = ResultFaults(self.stepper, self._answer_result)
        self._closed = False
        self._wire: InterceptedActionServer | None = None
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
        """The server is there: not dead, not closed."""
        return self._wire is not None

    @property
    def live_goals(self) -> list[str]:
        """The ids (hex) of the goals that are executing, oldest first."""
        with self.stepper.lock:
            return list(self._live)

    def open(self) -> None:
        """Be there; again after `die`. Nothing happens when it is there already, or closed."""
        with self.stepper.lock:
            if self._wire is not None or self._closed:
                return
            self._wire = InterceptedActionServer(
                self.node,
                self.action_type,
                self.name,
                interceptor=self,
                callback_group=self.stepper.group,
                goal_callback=self._decide,
                handle_accepted_callback=self._start,
                cancel_callback=self._cancel,
                result_timeout=self._result_timeout,
            )
            self.record("", Event.OPENED)

    def die(self, reason: str = "died") -> None:
        """Be gone, with all goals and without a word to anybody; `open` brings the server back."""
        with self.stepper.lock:
            if self._on_death is not None:
                self._on_death()
            self.abandon(reason)

    def restart(self, seconds: float) -> None:
        """Be gone for so many wall seconds. The process lives on, whoever owns it."""
        with self.stepper.lock:
            self.abandon("restart")
            self.stepper.call_at(self.stepper.now() + seconds, lambda now: self.open())

    def close(self) -> None:
        """Be gone for good. Safe while the executor spins and after it has stopped."""
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
        """Leave all goals where they are, and go."""
        with self.stepper.lock:
            self.record_death(reason)
            for live in self._live.values():
                self.stepper.stop(live)
                live.abandon(reason)
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
                state = self.state(live.run.motion)
                self.record(live.goal_id, Event.DIED, **state, reason=reason)
            if self._wire is not None:
                self.record("", Event.CLOSED, reason=reason)

    def record(self, goal_id: str, event: Event, **more: object) -> None:
        """Write a line into the journal."""
        self.journal.write(self.name, goal_id, event, **more)

    def ended(self, goal: LiveGoal, result: Any) -> None:
        """Send the result of a goal that has reached its terminal state."""
        self.stepper.stop(goal)
        self._live.pop(goal.goal_id, None)
        if self._wire is not None:
            self._wire.finish(goal.handle, result)
        self._results.ended(goal.goal_id, self.stepper.now(), self._result_timeout)

    # Requests, as the wire brings them.

    def on_request(self, kind: str, taken: Taken) -> bool:
        """Return whether to answer a request now."""
        with self.stepper.lock:
            if kind == "goal":
                return self._on_goal_request(taken)
            if kind == "cancel":
                return self._on_cancel_request(taken[1].goal_info)
            return self._results.on_request(_hex(taken[1].goal_id), taken)

    def on_answered(self, kind: str, taken: Taken) -> None:
        """Go on after an answer was sent."""
        with self.stepper.lock:
            if kind == "goal":
                goal_id = _hex(taken[1].goal_id)
                not_started = self._intake.answered(taken[1].goal, goal_id)
                handle = self._wire.handle_of(goal_id) if self._wire and not_started else None
                if handle is not None:
                    # The client went away before its answer; rclpy then starts nothing.
                    self._start(handle)
            elif kind == "cancel":
                for live in list(self._live.values()):
                    live.poll(self.stepper.now())
                    if live.run.due is not None:
                        self.stepper.call_at(live.run.due, live.poll)

    def _on_goal_request(self, taken: Taken) -> bool:
        wire = self._wire
        if wire is None:
            return False
        request = self._intake.receive(taken[1].goal, _hex(taken[1].goal_id))
        if request.faults:
            self._log.info(f"{self.name}: goal {request.number} meets {request.faults}")
        if request.fate is Fate.DIE:
            self.die("fault: die=accept")
        elif request.fate in {Fate.LATER, Fate.SILENT}:
            silent = request.fate is Fate.SILENT
            answer = partial(wire.later, "goal", taken, silent=silent)
            self.stepper.call_at(self.stepper.now() + request.delay, lambda now: answer())
        return request.fate is Fate.ANSWER

    def _on_cancel_request(self, goal_info: Any) -> bool:
        goal_id = _hex(goal_info.goal_id)
        asked = list(self._live) if goal_id == _ALL_GOALS else [goal_id]
        for each in asked:
            self.record(each, Event.CANCEL_REQUESTED)
        faults = [self._live[each].run.faults for each in asked if each in self._live]
        if any(of_goal.dies("cancel") for of_goal in faults):
            self.die("fault: die=cancel")
            return False
        return not any(FaultKind.DROP_CANCEL in of_goal for of_goal in faults)

    def _answer_result(self, taken: Taken) -> None:
        if self._wire is not None:
            self._wire.later("result", taken)

    # rclpy's callbacks.

    def _decide(self, goal: Any) -> GoalResponse:
        with self.stepper.lock:
            accepted = self._intake.decide(goal, self.refusal)
            return GoalResponse.ACCEPT if accepted else GoalResponse.REJECT

    def _start(self, handle: ServerGoalHandle) -> None:
        with self.stepper.lock:
            # The journal has it accepted before an older goal is aborted, so that a client which
            # has two goals at once is seen.
            request = self._intake.start(_hex(handle.goal_id))
            if request is None:
                return
            if self._preempts:
                for older in list(self._live.values()):
                    older.replace()
            motion, problem = self._begin(handle.request)
            now = self.stepper.now()
            run = Execution(motion, request.faults, now=now, time_limit=self._time_limit)
            period = self.stepper.step_period
            live = LiveGoal(self, self, request.goal_id, handle, run, step_period=period)
            self._live[request.goal_id] = live
            self._results.expect(request.goal_id, request.faults)
            handle.execute()
            if problem:
                live.give_up(problem)
            else:
                self.stepper.start(live)

    def _begin(self, goal: Any) -> tuple[Motion, str]:
        try:
            return self.begin(goal), ""
        except Exception as error:  # noqa: BLE001 - rclpy would leave the goal live for ever
            return _Nowhere(), f"it could not begin: {raised(error)}"

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        with self.stepper.lock:
            live = self._live.get(_hex(handle.goal_id))
            accepted = live is not None and live.cancel(self.stepper.now())
            return CancelResponse.ACCEPT if accepted else CancelResponse.REJECT


class _Nowhere:
    """The motion of a goal that could not begin."""

    progress = 0.0
    done = False

    def step(self, share: float) -> None:
        pass


def _hex(goal_id: Any) -> str:
    return bytes(goal_id.uuid).hex()
