"""Carries out what the goals of one endpoint have decided: records, sends, asks, cancels, reports.

What was true at the decision is looked at again here, and what fails is told to the goal. All
under the host's lock.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bt_actions.goals.terms import Command, Event, State
from bt_actions.traffic.begun import note, wake
from bt_actions.traffic.domain import Domain
from bt_actions.traffic.effects import Do
from bt_actions.traffic.handle import Endpoint, GoalHandle
from bt_actions.traffic.host import Entry, Host


class EffectRunner:
    """Runs the effects of one endpoint."""

    def __init__(
        self,
        endpoint: Endpoint,
        host: Host,
        domain: Domain,
        failed: Callable[[str, Exception], None],
    ) -> None:
        """`failed` is told what could not be done, which is asked for again later."""
        self._endpoint, self._host, self._domain, self._failed = endpoint, host, domain, failed
        self._does: dict[Do | Command, Callable[[GoalHandle], None]] = {
            Do.NOTE: lambda handle: note(host, handle),
            Do.WAKE_WAITING: self._wake_waiting,
            Do.RECORD: self._record_again,
            Do.STRIKE: lambda handle: host.record.strike(handle.goal.id),
            Do.RETIRE: endpoint.retire,
            Do.REPLACE: self._replace,
            Command.RELEASE: self._release,
            Command.ASK_RESULT: self._ask_result,
            Command.CANCEL: self._cancel,
        }

    def carry_out(self, do: Do | Command, handle: GoalHandle, message: Any) -> None:
        """Do this for a goal; `message` is what is to be sent."""
        self._host.trace.does(do)
        if do is Command.SEND:
            self._send(handle, message)
        else:
            self._does[do](handle)

    def _send(self, handle: GoalHandle, message: Any) -> None:
        """Count who gets it, have it on record, and send the request."""
        endpoint = self._endpoint
        try:
            handle.replies.sent(endpoint.watch)
            self._put_on_record(handle)
            endpoint.transport.send(handle.goal.id, message)
            known = handle.replies.sent_to
            endpoint.observe()
            handle.replies.sent(endpoint.watch)  # who opened since got it, too
            if handle.replies.sent_to != known:
                self._put_on_record(handle)
        except Exception as error:  # noqa: BLE001 - the handle's, or TypeError of a wrong message
            endpoint.tell(handle, Event.SEND_FAILED, error)

    def _ask_result(self, handle: GoalHandle) -> None:
        self._ask("ASK_RESULT", self._endpoint.transport.ask_result, handle.goal.id)

    def _cancel(self, handle: GoalHandle) -> None:
        if handle.goal.state is State.DONE:  # and nothing is sent after that
            self.send_cancel(handle.goal.id)
        else:
            self.ask_to_cancel(handle.goal.id)

    def ask_to_cancel(self, goal_id: bytes) -> None:
        """Ask the server to cancel a goal, as soon as its queue has room."""
        self._endpoint.cancels.ask(goal_id, self.send_cancel, self._host.steady())

    def send_cancel(self, goal_id: bytes) -> bool:
        """Ask now; return whether the request has left."""
        return self._ask("CANCEL", self._endpoint.transport.cancel, goal_id)

    def _ask(self, what: str, send: Callable[[bytes], None], goal_id: bytes) -> bool:
        try:
            send(goal_id)
        except Exception as error:  # noqa: BLE001 - the middleware's: any; it is asked again later
            self._failed(f"{what} could not be sent", error)
            return False
        return True

    def _release(self, handle: GoalHandle) -> None:
        for next_one in self._domain.resources.release(handle):
            next_one.endpoint.tell(next_one, Event.GRANTED)

    def _replace(self, handle: GoalHandle) -> None:
        for older in self._domain.resources.holders(handle.goal.resources):
            if older is handle:
                break
            older.endpoint.tell(older, Event.REPLACED, handle.goal.server)

    def _put_on_record(self, handle: GoalHandle) -> None:
        goal, servers = handle.goal, handle.replies.sent_to
        accept = goal.timeouts.accept or 0.0
        entry = Entry(self._endpoint.name, self._domain.number, servers, accept, goal.lost)
        self._host.record.enter(goal.id, entry)

    def _record_again(self, handle: GoalHandle) -> None:
        if handle.goal.id in self._host.record:
            self._put_on_record(handle)

    def _wake_waiting(self, handle: GoalHandle) -> None:
        """Wake those of all nodes whose goals may have waited for this one.

        There may be room at its server, or no conflict any more.
        """
        unsent, name, resources = self._domain.unsent, self._endpoint.name, handle.goal.resources
        for each in [each for each in unsent if each.goal.sent or each.goal.state is State.DONE]:
            del unsent[each]
        wake(e for e in unsent if e.endpoint.name == name or e.goal.resources & resources)
