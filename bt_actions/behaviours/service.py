"""A leaf that calls a ROS service and stays RUNNING until the answer comes. A tick never blocks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.common import Status

from bt_actions.behaviours.connected import Connected, Limited
from bt_actions.behaviours.topics import LOOKS
from bt_actions.expressions.text import ExpressionError
from bt_actions.goals.policy import Retry
from bt_actions.messages.conversion import fill
from bt_actions.messages.interfaces import interface
from bt_actions.traffic.backend import Backend, Call, Service


class CallService(Connected[Service], Limited):
    """A leaf that calls a service once, and again as `retry` says.

    A call without an answer in time may have been carried out all the same, and is tried again only
    where `retry` asks for that.

    Args:
        name: as in py_trees.
        service_type: the service's class or type name.
        service_name: a relative name is expanded with the node's namespace.
        request: gives the fields of the request; may raise ValueError, which fails.
        server: seconds to wait for the service to be there; None waits for ever.
        response: seconds to wait for the answer; None waits for ever.
        retry: how often, with `when` as a callable; its outcomes are not looked at, as a service
            has only one failure.
        read: called with the answer; returns the objection to it, or "".
    """

    in_words = "service"
    _call: Call | None = None
    _pausing = False

    def __init__(
        self,
        name: str,
        service_type: Any,
        service_name: str,
        request: Callable[[], object],
        *,
        server: float | None,
        response: float | None,
        retry: Retry,
        read: Callable[[Any], str],
    ) -> None:
        super().__init__(name)
        self.service_type = service_type
        self.retry = retry
        self.service_name = service_name
        self._request = request
        self._timeout, self._patience = server, response
        self._read = read

    def _make(self, backend: Backend) -> Service:
        self._call = None
        self.service_type = interface(self.service_type, "srv")
        return backend.service(self.service_type, self.service_name)

    def initialise(self) -> None:
        self._tries = 0
        self._pausing = False
        super().initialise()

    def update(self) -> Status:
        if self._pausing:
            if self.left() > 0.0:
                return Status.RUNNING
            self._pausing = False
            self.give(self._timeout)
        self._response: Any = None
        status = super().update()
        if status is Status.FAILURE and self._again():
            return Status.RUNNING
        return status

    def do(self) -> Status:
        backend, client = self._connection()
        call = self._call
        if call is not None:
            if call.done():
                self._call, self._response = None, call.result()
                if wrong := self._read(self._response):
                    raise ValueError(wrong)
                return Status.SUCCESS
            self.feedback_message = f"waiting for an answer of {client.name}"
            if self.left() <= 0.0:
                self._drop()
                raise ValueError(f"no answer within {self._patience:g} s")
        elif client.ready:
            try:
                request = fill(self.service_type.Request, self._request(), now=backend.stamp)
            except ValueError:
                self._tries = self.retry.attempts  # no other attempt would get further
                raise
            self._call = client.call(request)
            self.give(self._patience)
            self.feedback_message = f"called {client.name}"
        else:
            self.feedback_message = f"waiting for the service {client.name}"
            if self.left() <= 0.0:
                why = client.why_nobody()
                raise ValueError(f"no service {client.name} within {self._timeout:g} s{why}")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        self._drop()

    def due_in(self) -> float | None:
        """Return the seconds until the next deadline, attempt or look."""
        return self.left() if self._pausing or self._call is not None else LOOKS

    def left_to_run(self) -> float | None:
        is_last = self._call is not None and self.retry.attempts == 1
        return super().left_to_run() if is_last else None  # else another attempt follows

    def _drop(self) -> None:
        """Give up an open call: its answer is dropped."""
        if self._call is not None:
            self._call.cancel()
        self._call = None

    def _again(self) -> bool:
        """Return whether to try a failed call again; the pause before that begins."""
        self._tries += 1
        if self._tries >= self.retry.attempts:
            return False
        when = self.retry.when
        try:
            if callable(when) and self._response is not None and not when(self._response):
                return False
        except ExpressionError as error:  # no, as in goals/attempts.py
            self.feedback_message += f"; retry.when: {error.message}"
            return False
        self._pausing = True
        self.give(self.retry.pause(self._tries, self._connection()[0].randomness))
        return True
