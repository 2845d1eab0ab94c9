"""The transport of an action over rclpy: loses no answer, and can be read without an executor.

rclpy's client hands out a future for each request and completes it where it spins. Three things
follow that this project cannot live with, and each has its cure here:
- An answer may arrive before the request's sequence number has been filed, where the sender is
  not the executor's thread; it is then dropped ("Ignoring unexpected goal response", rclpy #1123).
  Sending with filing, and taking, are each done under one lock.
- The done-callbacks of futures are tasks of the executor: where nobody spins any more, they never
  run. Here answers go straight to a listener, and `deliver_arrived` takes them from any thread.
- Futures of requests that are never answered are kept for ever. Here `forget` drops them.
And one that matters where two servers have one name: the first answer is all that rclpy hears. Here
every answer to a question is told, with those before it.

What is taken waits in one inbox and is delivered in its order by whoever comes first: the executor,
or a call of `deliver_arrived`, after which nothing that had arrived before is still under way.

It carries messages and decides nothing. It uses the low-level handle of rclpy's ActionClient, whose
methods are checked for at construction; an executor waits for it through workarounds/one_waitable.
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
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_action_status_default
from rclpy.type_support import check_for_type_support
from unique_identifier_msgs.msg import UUID

from bt_actions.goals.terms import NEVER
from bt_actions.ros.graph import servers
from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.workarounds.statuses import status_reader
from bt_actions.servers.reachability import Reachability
from bt_actions.traffic.transport import GOALS_KEPT, Listener, nobodys
from bt_actions.utilities.plain_text import raised

TAKE_AT_MOST = 200
"""Messages of one kind taken at a time, so that a flood of feedback starves nobody."""
DEPTH = 100
"""Of our end of the services; with the default of 10 a burst of answers is lost silently."""

ASKED_KEPT = 10
"""Questions of one kind about one goal whose answers are waited for: the newest."""
ANSWERS_KEPT = 10
"""Answers to one question that are told: more servers of one name answer nothing new."""
_USED_OF_HANDLE = (
    "send_goal_request",
    "send_result_request",
    "send_cancel_request",
    "take_goal_response",
    "take_result_response",
    "take_cancel_response",
    "take_feedback",
    "take_status",
    "is_action_server_available",
    "add_to_waitset",
    "is_ready",
)


@dataclass(slots=True)
class _Question:
    """A request that was sent, and what came back."""

    about: bytes | int
    """A goal's id, or a probe's number."""
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
        """Create the client, which no executor knows of.

        Raises RuntimeError when this rclpy's low-level client lacks a method that is needed.
        """
        self._lock = threading.RLock()
        self._node, self._name, self._listener = node, action_name, listener
        self.seen_since = seen_since
        self._on_close = on_close
        self._goal_requests: dict[int, _Question] = {}
        self._past_requests: dict[int, _Question] = {}
        self._result_requests: dict[int, _Question] = {}
        self._cancel_requests: dict[int, _Question] = {}
        self._inbox: deque[tuple[str, Any, Any]] = deque()
        self.reachability = Reachability()
        """Under the one lock, as all requests."""
        self.on_trial = False
        """The listener has another client; here it wants to hear of statuses alone."""
        self.closed = False
        check_for_type_support(action_type)
        self._impl = action_type.Impl
        services = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
        feedback = QoSProfile(depth=DEPTH)
        profiles = services, services, services, feedback, qos_profile_action_status_default
        with node.handle:
            self.handle = rclpy_implementation.ActionClient(
                node.handle,
                action_type,
                action_name,
                *(profile.get_c_qos_profile() for profile in profiles),
            )
        missing = [name for name in _USED_OF_HANDLE if not hasattr(self.handle, name)]
        if missing:
            raise RuntimeError(f"this rclpy's action client has no {', '.join(missing)}")

    # Requests; each raises what rclpy raises when the handle or the context is no longer valid

    def send(self, goal_id: bytes, goal: Any) -> None:
        """Send the goal request."""
        request = self._impl.SendGoalService.Request()
        request.goal_id = UUID(uuid=list(goal_id))
        request.goal = goal
        with self._lock:
            number = self.handle.send_goal_request(request)
            self._goal_requests[number] = question = _Question(goal_id)
            self.reachability.asked(question.asked)

    def ask_result(self, goal_id: bytes) -> None:
        """Ask for the result, which the server answers when the goal has ended."""
        self._ask_result(goal_id, goal_id)

    def cancel(self, goal_id: bytes) -> None:
        """Ask the server to cancel this goal, and no other."""
        request = CancelGoal.Request()
        request.goal_info.goal_id = UUID(uuid=list(goal_id))
        with self._lock:
            number = self.handle.send_cancel_request(request)
            self._keep(self._cancel_requests, number, question := _Question(goal_id))
            self.reachability.asked(question.asked)

    def probe(self, probe: int) -> None:
        """Ask for a goal that nobody knows: each live server answers once, with status 0."""
        self.reachability.asked(self._ask_result(nobodys(probe), probe))

    def _ask_result(self, goal_id: bytes, about: bytes | int) -> float:
        request = self._impl.GetResultService.Request()
        request.goal_id = UUID(uuid=list(goal_id))
        with self._lock:
            number = self.handle.send_result_request(request)
            self._keep(self._result_requests, number, question := _Question(about))
        return question.asked

    @staticmethod
    def _keep(filed: dict[int, _Question], number: int, question: _Question) -> None:
        filed[number] = question
        same = [other for other, asked in filed.items() if asked.about == question.about]
        for oldest in same[:-ASKED_KEPT]:
            del filed[oldest]

    def forget(self, goal: bytes | int) -> None:
        """Drop what is still filed for a goal (its id) or a probe (its number)."""
        with self._lock:
            for filed in (self._goal_requests, self._result_requests, self._cancel_requests):
                for number in [number for number, asked in filed.items() if asked.about == goal]:
                    question = filed.pop(number)
                    if filed is self._goal_requests:
                        self._past_requests[number] = question
            while len(self._past_requests) > GOALS_KEPT:
                del self._past_requests[next(iter(self._past_requests))]

    # Answers

    def deliver_arrived(self) -> None:
        """Take and deliver what has arrived, here and now, whether or not somebody spins."""
        self.take_data()
        self.deliver()

    def take_data(self) -> None:
        """Take all that has arrived into the inbox."""
        taken = self._inbox
        status_type, read_statuses = status_reader()
        with self._lock:
            if self.closed:
                return
            with self.handle:
                for _ in range(TAKE_AT_MOST):
                    number, response = self.handle.take_goal_response(
                        self._impl.SendGoalService.Response
                    )
                    if response is None:
                        break
                    question = self._goal_requests.get(number) or self._past_requests.get(number)
                    self._file("goal", question, response.accepted)
                for _ in range(TAKE_AT_MOST):
                    feedback = self.handle.take_feedback(self._impl.FeedbackMessage)
                    if feedback is None:
                        break
                    taken.append(("feedback", bytes(feedback.goal_id.uuid), feedback.feedback))
                for _ in range(TAKE_AT_MOST):
                    number, response = self.handle.take_cancel_response(CancelGoal.Response)
                    if response is None:
                        break
                    question = self._cancel_requests.get(number)
                    if question is not None:
                        self._file("cancel", question, _cancel_code(response, question.about))
                for _ in range(TAKE_AT_MOST):
                    number, response = self.handle.take_result_response(
                        self._impl.GetResultService.Response
                    )
                    if response is None:
                        break
                    status = response.status
                    result = response.result if status else None
                    self._file("result", self._result_requests.get(number), (status, result))
                for _ in range(TAKE_AT_MOST):
                    message = self.handle.take_status(status_type)
                    if message is None:
                        break
                    taken.append(("status", read_statuses(message), None))

    def _file(self, kind: str, question: _Question | None, answer: Any) -> None:
        """Put an answer into the inbox, with those before it; none that nobody waits for."""
        if question is None or len(question.answers) >= ANSWERS_KEPT:
            return
        if isinstance(question.about, int):
            self._inbox.append(("probe", question.about, (question.asked,)))
            return
        question.answers.append(answer)
        self._inbox.append((kind, question.about, (question.asked, tuple(question.answers))))

    def deliver(self) -> None:
        """Deliver what has been taken."""
        with host.lock:
            any_came = bool(self._inbox)
            while self._inbox:
                kind, about, detail = self._inbox.popleft()
                try:
                    self._tell(kind, about, detail)
                except Exception as error:  # noqa: BLE001 - it would kill the executor's spin
                    log.error(f"{self._name}: {kind} was not taken in: {raised(error)}")
            if any_came:
                with contextlib.suppress(Exception):  # nothing was lost by that
                    self._listener.all_delivered()

    def _tell(self, kind: Any, about: Any, detail: Any) -> None:
        tell = self._listener
        if kind not in ("feedback", "status"):
            self.reachability.answered(asked=detail[0])
        if self.on_trial and kind != "status":
            return
        if kind == "feedback":
            tell.feedback_came(about, detail)
        elif kind == "status":
            tell.statuses_came(about)
        elif kind == "probe":
            tell.probe_answered(about)
        else:
            tell.answered(kind, about, *detail)

    @property
    def has_more(self) -> bool:
        """Whether something has been taken, and not been delivered yet."""
        return bool(self._inbox)

    # Discovery

    def servers(self) -> frozenset[bytes]:
        """Return the GIDs of the servers in sight; raises InvalidHandle where the node is gone."""
        return servers(self._node, self._name)

    def count(self) -> int:
        """How many readers of goal requests are shown, at a tenth of the cost of `servers`."""
        node = self._node.handle
        with node:
            return int(node.get_count_services(f"{self._name}/_action/send_goal"))

    def ready(self) -> bool:
        """Whether all parts of a server are in sight; raises InvalidHandle as well."""
        with self._node.handle:
            return bool(self.handle.is_action_server_available())

    def close(self) -> None:
        """Destroy the client. Answers that are still under way are lost."""
        with self._lock:
            if self.closed:
                return
            self.closed = True
            self.handle.destroy_when_not_in_use()
        self._on_close(self)


def _cancel_code(response: Any, goal_id: bytes | int) -> int:
    """Return the code that is meant: rclpy's servers answer 0 with an empty list for a refusal."""
    code = int(response.return_code)
    canceling = {bytes(goal.goal_id.uuid) for goal in response.goals_canceling}
    if code == CancelGoal.Response.ERROR_NONE and goal_id not in canceling:
        return int(CancelGoal.Response.ERROR_REJECTED)
    return code
