"""A leaf that calls a ROS service and stays RUNNING until it is answered. A tick never blocks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.common import Status

from bt_actions.behaviours.connected import Connected, Countdown, limit
from bt_actions.behaviours.reading import condition_of
from bt_actions.expressions.expression import ExpressionError
from bt_actions.goals.policy import Retry
from bt_actions.messages.conversion import fill
from bt_actions.messages.interfaces import interface
from bt_actions.traffic.backend import Backend, Service


class CallService(Connected[Service]):
    """Calls a service once, and again as `retry` says.

    A call that was not answered in time may have been carried out all the same: it is tried again
    only where `retry` asks for it.

    Args:
        name: as in py_trees.
        service_type: the service's class or type name.
        service_name: a relative name is expanded with the node's namespace.
        request: gives the fields of the request; may raise ValueError, which fails.
        server: seconds to wait for the service to be there; None waits for ever.
        response: seconds to wait for the answer; None waits for ever.
        retry: how often; its outcomes are not looked at, a service knows only one failure.
        expect: what the answer must be; raising ExpressionError counts as no.
        save: called with the answer; raising ExpressionError fails.
    """

    def __init__(
        self,
        name: str,
        service_type: type | str,
        service_name: str,
        request: Callable[[], object],
        *,
        server: float | None = 5.0,
        response: float | None = 5.0,
        retry: Retry | int = 1,
        expect: Callable[[Any], bool] | None = None,
        save: Callable[[Any], None] | None = None,
    ) -> None:
        super().__init__(name)
        self.service_type = service_type
        self.service_name = service_name
        self.retry = Retry.of(retry)
        self.response: Any = None
        self.attempt = 0
        self._request = request
        self._limits = limit(server), limit(response)
        self._expect = expect
        self._when = condition_of(self.retry.when, "retry.when")
        self._save = save
        self._pause = Countdown()

    def _make(self, backend: Backend) -> Service:
        self._pause.setup(backend)
        self.service_type = interface(self.service_type, "srv")
        return backend.service(self.service_type, self.service_name)

    def initialise(self) -> None:
        _, client = self._there()
        client.drop()
        self.attempt = 1
        self.response = None
        self._pause.start(0.0)
        self._countdown.start(self._limits[0])

    def update(self) -> Status:
        backend, client = self._there()
        if self._pause.left() > 0.0:
            return Status.RUNNING
        if not client.calling:
            return self._try_to_call(backend, client)
        if not client.answered:
            self.feedback_message = f"waiting for an answer of {client.name}"
            if self._countdown.left() <= 0.0:
                client.drop()
                return self._failed(f"no answer within {self._limits[1]:g} s")
            return Status.RUNNING
        try:
            self.response = client.answer()
            if self._expect is not None and not self._expect(self.response):
                return self._failed("the answer is not what was expected")
            if self._save is not None:
                self._save(self.response)
        except ValueError as error:  # ExpressionError, or what is saved does not fit
            return self._failed(str(error))
        self.feedback_message = ""
        return Status.SUCCESS

    def terminate(self, new_status: Status) -> None:
        if self._own is not None:
            self._own.drop()

    def due_in(self) -> float | None:
        """Seconds until the next deadline or try."""
        if self._pause.left() > 0.0:
            return self._pause.left()
        if self._own is None or not self._own.calling:
            return 0.05  # nothing announces that a service has come up
        return self._countdown.left()

    def _try_to_call(self, backend: Backend, client: Service) -> Status:
        if not client.ready:
            self.feedback_message = f"waiting for the service {client.name}"
            if self._countdown.left() <= 0.0:
                why = client.why_absent()
                return self._failed(f"no service {client.name} within {self._limits[0]:g} s{why}")
            return Status.RUNNING
        service_type: Any = self.service_type
        try:
            request: Any = fill(service_type.Request, self._request(), now=backend.clock.stamp)
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        client.call(request)
        self._countdown.start(self._limits[1])
        self.feedback_message = f"called {client.name}"
        return Status.RUNNING

    def _failed(self, reason: str) -> Status:
        self.feedback_message = reason
        if self.attempt >= self.retry.attempts or not self._worth_it():
            return Status.FAILURE
        self._pause.start(self.retry.pause(self.attempt, self._there()[0].randomness))
        self.attempt += 1
        self.response = None
        self._countdown.start(self._limits[0] + self._pause.left())
        return Status.RUNNING

    def _worth_it(self) -> bool:
        if self._when is None or self.response is None:
            return True
        try:
            return bool(self._when(self.response))
        except ExpressionError as error:  # counts as no, as in goals/attempts.py
            self.feedback_message += f"; retry.when: {error.message}"
            return False
