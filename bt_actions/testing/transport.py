"""One action as one participant of the virtual network sees it, and the participant.

These are the ActionTransport and the Participant of the seam. A sent message arrives a little
later, in order, and is delivered at once, so a `deliver_arrived` finds nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

from bt_actions.goals.terms import Now
from bt_actions.messages.interfaces import interface_name
from bt_actions.servers.presence import GID
from bt_actions.servers.reachability import Reachability
from bt_actions.testing.medium import Medium, Served, VirtualRequest
from bt_actions.traffic.state import Endpoint
from bt_actions.traffic.transport import GOALS_KEPT, Listener, Request
from bt_actions.utilities.suggest import did_you_mean, elsewhere, listing

LONG_AGO = float("-inf")


@dataclass(slots=True, eq=False)
class _Question:
    kind: Request
    goal_id: bytes
    asked: float
    answers: list[Any] = field(default_factory=list)


class VirtualTransport:
    """The transport of one action: requests out, answers to its listener."""

    def __init__(
        self,
        participant: VirtualParticipant,
        action_type: Any,
        name: str,
        listener: Listener,
    ) -> None:
        self.beside_another = False
        self.closed = False
        self.reachability = Reachability()
        self.seen_since = LONG_AGO
        self.has_more = False
        self.name = name
        self.action_type = action_type
        self._participant = participant
        self._medium = participant.medium
        self._listener = listener
        self._questions: dict[_Question, None] = {}
        self._past: list[_Question] = []
        self._medium.add_client(self)

    # Requests

    def send(self, goal_id: bytes, goal: Any) -> None:
        self.reachability.asked(self._now)
        self._ask("goal", goal_id, goal)

    def ask_result(self, goal_id: bytes) -> None:
        self._ask("result", goal_id)

    def cancel(self, goal_id: bytes) -> None:
        self.reachability.asked(self._now)
        self._ask("cancel", goal_id)

    def forget(self, goal_id: bytes) -> None:
        about = [question for question in self._questions if question.goal_id == goal_id]
        for question in about:
            del self._questions[question]
        self._past += [question for question in about if question.kind == "goal"]
        del self._past[:-GOALS_KEPT]

    @property
    def _now(self) -> float:
        return self._medium.timeline.now

    def _ask(self, kind: Request, goal_id: bytes, goal: Any = None) -> None:
        if self.closed or not self._participant.alive():
            raise RuntimeError(f"{self.name}: this transport, or its participant, was closed")
        question = _Question(kind, goal_id, self._now)
        self._questions[question] = None
        reply = partial(self._medium.soon, self._answered, question)
        request = VirtualRequest(kind, goal_id.hex(), goal, reply)
        for server in self._shown():
            self._medium.soon(server.receive, request)

    # Answers

    def deliver_arrived(self) -> None:
        """Do nothing: all arrived messages were delivered."""

    def _answered(self, question: _Question, answer: Any) -> None:
        if self.closed or not (question in self._questions or question in self._past):
            return
        tell = self._listener
        self.reachability.answer_came(question.asked)
        question.answers.append(answer)
        tell.answer_came(question.kind, question.goal_id, question.asked, tuple(question.answers))
        tell.all_delivered()

    def hear_feedback(self, goal_id: bytes, feedback: Any) -> None:
        if not (self.closed or self.beside_another):
            self._listener.feedback_came(goal_id, feedback)
            self._listener.all_delivered()

    def hear_status(self, statuses: dict[bytes, int]) -> None:
        if not self.closed:
            self._listener.statuses_came(statuses)
            self._listener.all_delivered()

    # Sight

    def _shown(self) -> list[Served]:
        return self._medium.servers_of(self)

    def servers(self) -> frozenset[GID]:
        if not self._participant.alive():
            raise RuntimeError("this participant is gone")
        return frozenset(server.gid for server in self._shown())

    def count(self) -> int:
        return len(self.servers())

    def ready(self) -> bool:
        return bool(self.servers())

    def close(self) -> None:
        if not self.closed:
            self.closed = True
            self._medium.remove_client(self)


class VirtualParticipant:
    """A node on the virtual network, which has discovered all parties from the beginning."""

    seen_since = LONG_AGO
    long_stalls = 0

    def __init__(self, medium: Medium, name: str, namespace: str) -> None:
        self.medium = medium
        self.name = name
        self.namespace = namespace
        self.domain = 0
        self._alive = True

    def now(self) -> Now:
        return Now(self.medium.timeline.now, self.medium.timeline.now)

    def alive(self) -> bool:
        return self._alive

    def close(self) -> None:
        """Leave the network, as a destroyed node does."""
        self._alive = False

    def shut_down(self) -> bool:
        return False

    def full_name(self, action: str) -> str:
        if action.startswith("/"):
            return action
        own = f"{self.name}{action[1:]}" if action.startswith("~") else action
        return f"{self.namespace.rstrip('/')}/{own}"

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> VirtualTransport:
        return VirtualTransport(self, action_type, name, listener)

    def instead(self, action_type: Any, name: str) -> str:
        served = {each: interface_name(kind) for each, kind in self.medium.actions.items()}
        ours = interface_name(action_type)
        if name in served:
            return f"; there is one of another type, {served[name]}"
        if not served:
            return "; no action server at all is on this network"
        if found := elsewhere(name, ours, {each: (kind,) for each, kind in served.items()}):
            return found
        if of_its_type := sorted(each for each in served if served[each] == ours):
            return f"; of its type there is {listing(of_its_type)}"
        return did_you_mean(name, served)

    def unheard(self) -> str:
        """Return "": no process of another user is here."""
        return ""

    def seek(self, endpoint: Endpoint) -> None:
        """Do nothing: a second participant would see the same."""
