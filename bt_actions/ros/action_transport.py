"""The transport of an action over rclpy: loses no answer, and can be read without an executor.

rclpy's client hands out a future for each request and completes it where it spins. This project
cannot live with three consequences, and each has its cure here:

- An answer may arrive before the request's sequence number has been filed, where the sender is
  not the executor's thread; rclpy then drops it ("Ignoring unexpected goal response", rclpy #1123).
  Here one lock covers the sending with the filing, and another hold of it the taking.
- The done-callbacks of futures are tasks of the executor: where nobody spins any more, they never
  run. Here answers go straight to a listener, and `deliver_arrived` takes them from any thread.
- Futures of requests that are never answered are kept for ever. Here `forget` drops them.

A fourth consequence matters where two servers have one name: rclpy hears the first answer alone.
Here every answer to a question is told, with those before it.

Taken answers wait in one inbox, and are delivered in order by the first thread that comes: the
thread of receiving.py, or a caller of `deliver_arrived`, after which nothing that had arrived
before is still under way.

The transport carries messages and decides nothing. It uses the low-level handle of rclpy's
ActionClient.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_action_status_default
from rclpy.type_support import check_for_type_support

from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, NEVER
from bt_actions.ros.graph import servers
from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.workarounds.statuses import status_reader
from bt_actions.servers.reachability import Reachability
from bt_actions.traffic.transport import GOALS_KEPT, Listener, Request
from bt_actions.utilities.plain_text import raised

FEEDBACK_AT_MOST = 200
"""Messages of feedback taken at a time, so that a flood of them starves nobody."""
DEPTH = 100
"""The depth of our end of the services; with the default of 10 a burst of answers is lost silently.
"""

ASKED_KEPT = ANSWERS_KEPT = 10
"""The newest questions of one kind about one goal that wait for answers, and the answers to one
that are told: more servers of one name answer nothing new.
"""


@dataclass(slots=True)
class _Question:
    """A sent request, and its answers."""

    goal_id: bytes
    asked: float = field(default_factory=time.monotonic)
    answers: list[Any] = field(default_factory=list)


class RosTransport:
    """One action as one node sees it (transport.ActionTransport)."""

    def __init__(
        self,
        node: Node,
        action_type: Any,
        action_name: str,
        listener: Listener,
        seen_since: float = NEVER,
        on_close: Callable[[RosTransport], None] = lambda _: None,
    ) -> None:
        """Create the client, which no executor knows of."""
        self._lock = threading.RLock()
        self._node, self._name, self._listener = node, action_name, listener
        self.seen_since = seen_since
        self._on_close = on_close
        self._questions: dict[tuple[Request, int], _Question] = {}
        """Questions by their kind, and rclpy's number of each."""
        self._past: dict[tuple[Request, int], _Question] = {}
        """The goal requests of goals that were forgotten."""
        self._inbox: deque[tuple[Callable[..., None], tuple[Any, ...], float | None]] = deque()
        """Calls of the listener, each with the moment of its question."""
        self.reachability = Reachability()
        """Under the one lock, as all requests."""
        self.beside_another = False
        """Whether the listener has another client, and hears of feedback by that alone."""
        self.closed = False
        check_for_type_support(action_type)
        self._impl = action_type.Impl
        services = feedback = QoSProfile(depth=DEPTH)
        profiles = services, services, services, feedback, qos_profile_action_status_default
        self._counted = node.resolve_service_name(f"{action_name}/_action/send_goal")
        with node.handle:
            self.handle = rclpy_implementation.ActionClient(
                node.handle,
                action_type,
                action_name,
                *(profile.get_c_qos_profile() for profile in profiles),
            )

    # Requests; each raises what rclpy raises when the handle or the context is no longer valid

    def send(self, goal_id: bytes, goal: Any) -> None:
        request = self._impl.SendGoalService.Request(goal=goal)
        request.goal_id.uuid = list(goal_id)
        self.reachability.asked(self._ask("goal", request, goal_id))

    def ask_result(self, goal_id: bytes) -> None:
        request = self._impl.GetResultService.Request()
        request.goal_id.uuid = list(goal_id)
        self._ask("result", request, goal_id)

    def cancel(self, goal_id: bytes) -> None:
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(goal_id)
        self.reachability.asked(self._ask("cancel", request, goal_id))

    def _ask(self, kind: Request, request: Any, goal_id: bytes) -> float:
        """Send a request and file it, before its answer is taken; return when it was sent."""
        with self._lock:
            number = getattr(self.handle, f"send_{kind}_request")(request)
            question = self._questions[kind, number] = _Question(goal_id)
            asked = self._questions.items()
            same = [key for key, each in asked if key[0] == kind and each.goal_id == goal_id]
            for oldest in same[:-ASKED_KEPT]:
                del self._questions[oldest]
        return question.asked

    def forget(self, goal_id: bytes) -> None:
        with self._lock:
            for key in [key for key, asked in self._questions.items() if asked.goal_id == goal_id]:
                question = self._questions.pop(key)
                if key[0] == "goal":
                    self._past[key] = question
            while len(self._past) > GOALS_KEPT:
                del self._past[next(iter(self._past))]

    # Answers

    def deliver_arrived(self) -> None:
        self.take_data()
        self.deliver()

    def take_data(self) -> None:
        """Take all that has arrived into the inbox."""
        with self._lock:
            if self.closed:
                return
            handle, impl = self.handle, self._impl
            put, tell = self._inbox.append, self._listener
            status_type, read_statuses = status_reader()
            with handle:
                while (taken := handle.take_goal_response(impl.SendGoalService.Response))[1]:
                    self._file("goal", taken[0], taken[1].accepted)
                for _ in range(FEEDBACK_AT_MOST):
                    if (message := handle.take_feedback(impl.FeedbackMessage)) is None:
                        break
                    put((tell.feedback_came, (bytes(message.goal_id.uuid), message.feedback), None))
                while (taken := handle.take_cancel_response(CancelGoal.Response))[1]:
                    code = taken[1].return_code
                    if code == CANCEL_ACCEPTED and not taken[1].goals_canceling:
                        code = CANCEL_REJECTED  # as rclpy's servers have it
                    self._file("cancel", taken[0], code)
                while (taken := handle.take_result_response(impl.GetResultService.Response))[1]:
                    status = taken[1].status
                    self._file("result", taken[0], (status, taken[1].result if status else None))
                while (message := handle.take_status(status_type)) is not None:
                    put((tell.statuses_came, (read_statuses(message),), None))

    def _file(self, kind: Request, number: int, answer: Any) -> None:
        """Put an answer into the inbox, with those before it; drop one that nobody waits for."""
        key = kind, number
        question = self._questions.get(key) or self._past.get(key)
        if question is None or len(question.answers) >= ANSWERS_KEPT:
            return
        question.answers.append(answer)
        told = kind, question.goal_id, question.asked, tuple(question.answers)
        self._inbox.append((self._listener.answer_came, told, question.asked))

    def deliver(self) -> None:
        """Deliver the inbox."""
        with host.lock:
            any_came = bool(self._inbox)
            while self._inbox and not self.closed:
                tell, what, asked = self._inbox.popleft()
                if asked is not None:
                    self.reachability.answer_came(asked)
                if self.beside_another and tell == self._listener.feedback_came:
                    continue
                try:
                    tell(*what)
                except Exception as error:  # noqa: BLE001 - the others still want to hear
                    log.error(f"{self._name}: a message could not be processed: {raised(error)}")
            if any_came:
                with contextlib.suppress(Exception):  # nothing was lost by that
                    self._listener.all_delivered()

    @property
    def has_more(self) -> bool:
        return bool(self._inbox)

    # Discovery

    def servers(self) -> frozenset[bytes]:
        return servers(self._node, self._name)

    def count(self) -> int:
        node = self._node.handle
        with node:
            return int(node.get_count_services(self._counted))

    def ready(self) -> bool:
        with self._node.handle:
            return bool(self.handle.is_action_server_available())

    def close(self) -> None:
        with self._lock:
            if self.closed:
                return
            self.closed = True
        self._on_close(self)
        self.handle.destroy_when_not_in_use()
