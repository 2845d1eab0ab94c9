"""Leaves and values that listen to topics and speak on them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.clock import Countdown, NodeTime
from bt_actions.behaviours.node import node_in
from bt_actions.expression import ExpressionError

if TYPE_CHECKING:
    from bt_actions.ros.topics import Latest

__all__ = ["Publish", "TopicValue", "WaitForMessage"]


def _class(message_type: type | str) -> type:
    if isinstance(message_type, type):
        return message_type
    from bt_actions.ros.interfaces import interface

    return interface(message_type, "msg")


class TopicValue:
    """A topic whose latest message a tree reads as a variable."""

    def __init__(
        self, name: str, message_type: type | str, topic: str, qos: str, max_age: float | None
    ) -> None:
        self.name = name
        self._type = message_type
        self._topic = topic
        self._qos = qos
        self._max_age = max_age
        self._node: Any = None
        self._latest: Latest | None = None

    def connect(self, node: Any) -> None:
        """Subscribe on a node; again for the same node: nothing."""
        if node is None or node is self._node:
            return
        from bt_actions.ros.topics import Latest

        self.close()
        self._latest = Latest(node, _class(self._type), self._topic, self._qos)
        self._node = node

    def close(self) -> None:
        """Unsubscribe."""
        if self._latest is not None:
            self._latest.close()
        self._latest = self._node = None

    def read(self) -> object:
        """The latest message. Raises ExpressionError when there is none, or it is too old."""
        message, age = (None, 0.0) if self._latest is None else self._latest.get()
        topic = self._topic if self._latest is None else self._latest.topic
        if message is None:
            raise ExpressionError(f"nothing has come on {topic} yet (${self.name})")
        if self._max_age is not None and age > self._max_age:
            raise ExpressionError(f"the last message on {topic} is {age:.1f} s old (${self.name})")
        return message


class WaitForMessage(Behaviour):
    """Succeeds with the first message, since it started, for which a condition holds.

    Args:
        name: as in py_trees.
        message_type: the message's class or type name.
        topic: a relative name is expanded with the node's namespace.
        qos: as the tree language calls it.
        until: a condition on the message; any message does where not given.
        timeout: seconds on the node's clock after which it fails; never where not given.
        save: called with such a message; where it raises ValueError (ExpressionError is one), that
            message was not the one waited for.
    """

    def __init__(
        self,
        name: str,
        message_type: type | str,
        topic: str,
        *,
        qos: str = "default",
        until: Callable[[Any], bool] | None = None,
        timeout: float | None = None,
        save: Callable[[Any], None] | None = None,
    ) -> None:
        super().__init__(name)
        self._type = message_type
        self._topic = topic
        self._qos = qos
        self._until = until
        self._timeout = timeout
        self._save = save
        self._clock = NodeTime()
        self._countdown = Countdown(self._clock)
        self._node: Any = None
        self._latest: Latest | None = None

    def setup(self, **kwargs: Any) -> None:
        node = node_in(kwargs, self)
        if node is self._node:
            return
        from bt_actions.ros.topics import Latest

        self.shutdown()
        self._clock.setup(node)
        self._latest = Latest(node, _class(self._type), self._topic, self._qos)
        self._node = node
        if self.status is Status.RUNNING:  # shut down in its visit, and set up again
            self._latest.keep()

    def initialise(self) -> None:
        if self._latest is not None:  # what a latched topic delivered before is as good as new
            self._latest.keep(with_latest=self._qos == "latched")
        if self._timeout is not None:
            self._countdown.start(self._timeout)

    def update(self) -> Status:
        assert self._latest is not None, "not set up"
        self.feedback_message = f"waiting for a message on {self._topic}"
        for message in self._latest.take():
            try:
                if self._until is None or self._until(message):
                    if self._save is not None:
                        self._save(message)
                    self.feedback_message = ""
                    return Status.SUCCESS
                self.feedback_message = "a message came, but not the one waited for"
            except ValueError as error:  # ExpressionError, or what is saved does not fit
                self.feedback_message = str(error)
        if self._timeout is not None and self._countdown.left() <= 0.0:
            self.feedback_message = f"no such message on {self._topic} within {self._timeout:g} s"
            return Status.FAILURE
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        if self._latest is not None:
            self._latest.keep_no_more()

    def due_in(self) -> float | None:
        """Seconds until it fails."""
        return None if self._timeout is None else self._countdown.left()

    def shutdown(self) -> None:
        if self._latest is not None:
            self._latest.close()
        self._latest = self._node = None


class Publish(Behaviour):
    """Publishes one message and succeeds; fails when the message cannot be built.

    Args:
        name: as in py_trees.
        message_type: the message's class or type name.
        topic: a relative name is expanded with the node's namespace.
        data: gives the fields of the message; may raise ValueError.
        qos: as the tree language calls it.
    """

    def __init__(
        self,
        name: str,
        message_type: type | str,
        topic: str,
        data: Callable[[], object],
        *,
        qos: str = "default",
    ) -> None:
        super().__init__(name)
        self._type = message_type
        self._topic = topic
        self._data = data
        self._qos = qos
        self._node: Any = None
        self._publisher: Any = None

    def setup(self, **kwargs: Any) -> None:
        node = node_in(kwargs, self)
        if node is self._node:
            return
        from bt_actions.ros.closable import closable
        from bt_actions.ros.topics import qos_profile

        self.shutdown()
        profile = qos_profile(self._qos)
        self._publisher = closable(node.create_publisher(_class(self._type), self._topic, profile))
        self._node = node

    def update(self) -> Status:
        from bt_actions.ros.messages import fill

        assert self._publisher is not None, "not set up"
        clock = self._node.get_clock()
        try:
            message: Any = fill(
                _class(self._type), self._data(), now=lambda: int(clock.now().nanoseconds)
            )
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self._publisher.publish(message)
        self.feedback_message = ""
        return Status.SUCCESS

    def shutdown(self) -> None:
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
        self._publisher = self._node = None
