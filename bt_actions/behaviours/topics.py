"""Leaves and values with topics, for listening and publishing."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.connected import Connected, Limited, Stopwatch
from bt_actions.expressions.text import ExpressionError
from bt_actions.messages.conversion import fill
from bt_actions.messages.interfaces import interface
from bt_actions.traffic.backend import Backend, Publisher, Subscription
from bt_actions.traffic.state import waker

LOOKS = 0.05
"""Seconds between two looks for a listener or a service, whose coming nothing announces."""
READ = "topics_read"
"""The attribute of a behaviour with the names of the topics that its values come from."""
KEPT = 100
"""Messages kept for a leaf that waits for one of them; older messages are dropped."""


class TopicValue(Connected[Subscription]):
    """A topic whose latest message a tree reads as a variable. The value itself is in no tree."""

    def __init__(
        self, name: str, message_type: type | str, topic: str, qos: str, max_age: float | None
    ) -> None:
        self.name, self.topic = name, topic
        self._given = message_type, topic, qos
        self._max_age = max_age
        self.default: Callable[[], object] | None = None
        """Gives the value before the first message, and when the last one is too old."""
        self._look_again_at = 0.0
        self._newest: tuple[Any, Stopwatch] | None = None
        """The latest message, with its age on the node's clock."""

    def setup(self, **kwargs: Any) -> None:
        """Subscribe where there is a node, once for each."""
        if kwargs.get("node") is not None:
            self._wake = waker()
            super().setup(**kwargs)

    def _make(self, backend: Backend) -> Subscription:
        def take(message: Any) -> None:
            self._newest = message, Stopwatch(lambda: backend.now().ros)
            self._wake()

        self._newest = None
        message_type, topic, qos = self._given
        return backend.subscription(interface(message_type, "msg"), topic, qos, take)

    def read(self) -> object:
        """Return the latest message, or the default, where the message is missing or too old.

        Raises ExpressionError without a default.
        """
        if self.default is None:
            return self._latest()
        try:
            return self._latest()
        except ExpressionError:
            return self.default()

    def _latest(self) -> object:
        if self._backend is None:
            raise ExpressionError(f"no message has come on {self._given[1]} yet (${self.name})")
        topic = self._own.name
        if self._newest is None:
            now = self._backend.now().steady
            if now >= self._look_again_at:  # a tree may ask at each tick
                self._said, self._look_again_at = self._own.why_nobody(), now + 1.0
            raise ExpressionError(f"no message has come on {topic} yet (${self.name}){self._said}")
        message, since = self._newest
        age = since.passed()
        if self._max_age is not None and age > self._max_age:
            raise ExpressionError(f"the last message on {topic} is {age:.1f} s old (${self.name})")
        return message

    def first_may_come(self) -> float:
        """Return the seconds in which the first message may be on its way; 0 afterwards."""
        if self.default is not None:
            return 0.0
        return 0.0 if self._own is None or self._newest else float(self._own.may_come())


def patient(behaviour: Behaviour, topics: list[TopicValue]) -> None:
    """Have a behaviour begin its visits only when the topics that it reads can be asked.

    The behaviour is RUNNING as long as the first message of one may still be on its way, as in a
    process that has just begun. Its own code is not called before.
    """
    tick, due_in = behaviour.tick, getattr(behaviour, "due_in", lambda: None)
    awaited: list[TopicValue] = []

    def tick_patiently() -> Iterator[Behaviour]:
        if awaited or behaviour.status is not Status.RUNNING:
            awaited[:] = [topic for topic in topics if topic.first_may_come() > 0.0]
            if awaited:
                behaviour.feedback_message = f"waiting for a first message: ${awaited[0].name}"
                behaviour.status = Status.RUNNING
                yield behaviour
                return
            behaviour.status = Status.INVALID  # the visit begins now
        yield from tick()

    def due() -> Any:
        return max(topic.first_may_come() for topic in awaited) if awaited else due_in()

    behaviour.tick = tick_patiently  # type: ignore[method-assign]
    behaviour.due_in = due  # type: ignore[attr-defined]


class WaitForMessage(Connected[Subscription], Limited):
    """A leaf that succeeds with the first message, since its start, that `read` accepts.

    Args:
        name: as in py_trees.
        message_type: the message's class or type name.
        topic: a relative name is expanded with the node's namespace.
        qos: a name of the tree language.
        timeout: seconds on the node's clock after which it fails; None: never.
        read: called with each message; returns the objection to it, or "".
    """

    def __init__(
        self,
        name: str,
        message_type: type | str,
        topic: str,
        *,
        qos: str,
        timeout: float | None,
        read: Callable[[Any], str],
    ) -> None:
        super().__init__(name)
        self._given = message_type, topic, qos
        self.topic_name = topic
        self._timeout = timeout
        self._read = read
        self._kept: deque[Any] = deque(maxlen=0)  # unread ones, while it waits

    def _make(self, backend: Backend) -> Subscription:
        self._came, self._newest, self._wake = 0, list[Any](), waker()
        message_type, topic, qos = self._given
        return backend.subscription(interface(message_type, "msg"), topic, qos, self._take)

    def _take(self, message: Any) -> None:
        self._came += 1
        self._newest = [message]
        self._kept.append(message)
        self._wake()

    def initialise(self) -> None:
        super().initialise()
        self._connection()
        self._came_before, self._wake = self._came, waker()
        # An earlier message of a latched topic is as good as new
        self._kept = deque(self._newest if self._given[2] == "latched" else (), KEPT)

    def do(self) -> Status:
        _, subscription = self._connection()
        topic = subscription.name
        self.feedback_message = f"waiting for a message on {topic}"
        for _ in range(len(self._kept)):  # no later ones: a tick must end
            self.feedback_message = self._read(self._kept.popleft())
            if not self.feedback_message:
                return Status.SUCCESS
        if self.left() > 0.0:
            return Status.RUNNING
        why = "" if self._came else subscription.why_nobody()
        if self._came_before:
            why = f"; {self._came_before} came before it began"
        raise ValueError(f"no such message on {topic} within {self._timeout:g} s{why}")

    def terminate(self, new_status: Status) -> None:
        self._kept = deque(maxlen=0)


class Publish(Connected[Publisher], Limited):
    """A leaf that publishes one message and succeeds, or fails when the message cannot be built.

    The leaf first waits for `subscribers` subscribers, where that number is given. Otherwise the
    leaf waits for one subscriber, but only in the first 3.5 seconds of the node, as discovery takes
    time. Without a subscriber the leaf publishes and succeeds, and `warning` says so. `shutdown`
    returns when all subscribers have the last message, or a second after it was published.

    Args:
        name: as in py_trees.
        message_type: the message's class or type name.
        topic: a relative name is expanded with the node's namespace.
        data: gives the fields of the message; may raise ValueError.
        qos: a name of the tree language.
        subscribers: so many must listen before it publishes.
        timeout: seconds on the node's clock after which it fails where fewer do, and not while the
            node is new; None: never.
    """

    warning = ""
    """The words beside a SUCCESS where nobody listened."""

    def __init__(
        self,
        name: str,
        message_type: Any,
        topic: str,
        data: Callable[[], object],
        *,
        qos: str,
        subscribers: int,
        timeout: float | None,
    ) -> None:
        super().__init__(name)
        self._type = message_type
        self._given = topic, qos
        self._data = data
        self._subscribers = subscribers
        self._timeout = timeout

    def _make(self, backend: Backend) -> Publisher:
        self._type = interface(self._type, "msg")
        return backend.publisher(self._type, *self._given)

    def do(self) -> Status:
        backend, publisher = self._connection()
        topic, listeners = publisher.name, publisher.listeners
        some_may_come = publisher.may_come() > 0.0
        if listeners < (self._subscribers or some_may_come):
            if self._subscribers and not some_may_come and self.left() <= 0.0:
                raise ValueError(
                    f"{listeners} of {self._subscribers} subscribers listen on {topic} after"
                    f" {self._timeout:g} s{publisher.why_nobody()}"
                )
            self.feedback_message = f"waiting for a subscriber of {topic}"
            return Status.RUNNING
        publisher.publish(fill(self._type, self._data(), now=backend.stamp))
        why = "" if listeners else f"nobody listens on {topic}{publisher.why_nobody()}"
        self.feedback_message = self.warning = why
        return Status.SUCCESS

    def due_in(self) -> float | None:
        """Return the seconds until the next look for listeners."""
        return LOOKS
