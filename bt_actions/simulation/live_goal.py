"""One accepted goal on its server: carries out what its execution decides, and writes it down."""

from __future__ import annotations

from typing import Any, Protocol

from bt_actions.goals.terms import STATUS_ABORTED, STATUS_CANCELED, STATUS_SUCCEEDED
from bt_actions.messages.interfaces import short_name
from bt_actions.simulation.execution import CancelAnswer, Execution, Finish, Happened
from bt_actions.simulation.goal_meaning import GoalMeaning
from bt_actions.simulation.journal import Event
from bt_actions.simulation.platform import Wire
from bt_actions.utilities.plain_text import raised

_STATUSES = {Finish.COMPLETED: STATUS_SUCCEEDED, Finish.CANCELED: STATUS_CANCELED}
_EVENTS = {STATUS_SUCCEEDED: Event.SUCCEEDED, STATUS_CANCELED: Event.CANCELED}


class Owner(Protocol):
    """What a live goal asks of its server."""

    def record(self, goal_id: str, event: Event, **more: object) -> None:
        """Write a line into the journal."""

    def broken(self, goal_id: str, reason: str) -> None:
        """What a goal means has raised: a line into the log."""

    def ended(self, goal: LiveGoal, result: Any) -> None:
        """The goal has reached its terminal state."""

    def die(self, reason: str) -> None:
        """A fault kills the server."""

    def restart(self, seconds: float) -> None:
        """A fault takes the server away for so many seconds."""


class LiveGoal:
    """A goal from its acceptance to its end. Used under the lock of its server's stepper."""

    def __init__(
        self,
        owner: Owner,
        meaning: GoalMeaning,
        goal_id: str,
        wire: Wire,
        run: Execution,
        *,
        step_period: float,
    ) -> None:
        """`run` decides, `meaning` makes the messages, `owner` is told."""
        self.goal_id = goal_id
        self._wire = wire
        self.run = run
        self._owner = owner
        self._meaning = meaning
        self._step_period = step_period

    def __repr__(self) -> str:
        return f"<LiveGoal {self.goal_id[:8]} {self.run!r}>"

    def step(self, now: float) -> bool:
        try:
            happened = self.run.step(now, self._step_period)
        except Exception as error:  # noqa: BLE001 - the goal must end whatever its motion does
            happened = self.run.give_up(self._broken(f"it could not go on: {raised(error)}"))
        self._owner.record(self.goal_id, Event.STEP, **self._meaning.state(self.run.motion))
        self._carry_out(happened)
        return self.run.moving

    def poll(self, now: float) -> None:
        """End, where a cancel's time has come."""
        self._carry_out(self.run.poll(now))

    def cancel(self, now: float) -> bool:
        """Say whether a request to cancel is granted; it is carried out by `poll`."""
        accepted = self.run.cancel(now) is CancelAnswer.ACCEPT
        event = Event.CANCEL_ACCEPTED if accepted else Event.CANCEL_REJECTED
        self._owner.record(self.goal_id, event)
        return accepted

    def replace(self) -> None:
        """Abort: a newer goal takes its place."""
        self._carry_out(self.run.replace())

    def give_up(self, reason: str) -> None:
        """Abort, because the server cannot go on."""
        self._carry_out(self.run.give_up(reason))

    def abandon(self, reason: str) -> None:
        """Stop without an end that any client hears of: the server has died."""
        self.run.give_up(reason)
        self._meaning.halt(self.run.motion)

    def _carry_out(self, happened: Happened) -> None:
        if happened.drop_part:
            self._meaning.drop_part()
        if happened.feedback:
            self._send_feedback(happened.feedback)
        if happened.finish is not None:
            self._finish(happened.finish, happened.reason)
        if happened.restart_after is not None:
            self._owner.restart(happened.restart_after)
        elif happened.die:
            self._owner.die("fault: die")

    def _broken(self, reason: str) -> str:
        self._owner.broken(self.goal_id, reason)
        return reason

    def _send_feedback(self, times: int) -> None:
        try:
            message = self._meaning.feedback(self.run.motion)
            for _ in range(times):
                self._wire.feedback(self.goal_id, message)
        except Exception as error:  # noqa: BLE001 - the goal must end whatever its script does
            self.give_up(self._broken(f"it has no feedback: {raised(error)}"))

    def _finish(self, finish: Finish, reason: str) -> None:
        motion = self.run.motion
        try:
            if finish is Finish.COMPLETED and (why := self._meaning.failure(motion)):
                finish, reason = Finish.FAULT, why
            if finish is not Finish.COMPLETED:
                self._meaning.halt(motion)
            result = self._meaning.result(motion, finish, reason)
            if not isinstance(result, self._meaning.action_type.Result):
                raise TypeError(f"{result!r} is no {short_name(self._meaning.action_type.Result)}")
        except Exception as error:  # noqa: BLE001 - the goal must end whatever its script does
            finish, reason = Finish.FAULT, self._broken(f"it has no result: {raised(error)}")
            result = self._meaning.action_type.Result()
        status = self._wire.end(self.goal_id, _STATUSES.get(finish, STATUS_ABORTED))
        event = _EVENTS.get(status, Event.ABORTED)
        more = {"reason": reason} if reason else {}
        self._owner.record(self.goal_id, event, **self._meaning.state(motion), **more)
        self._owner.ended(self, result)
