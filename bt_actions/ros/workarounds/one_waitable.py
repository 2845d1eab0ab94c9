"""All action transports of a node, as one entity of its executor.

rclpy's executor builds its wait set anew for each spin, and spends 15 us of Python on each action
client in it: 50 robots with two actions cost 1.5 ms a spin. Here it sees one entity, which adds
their C clients to the wait set itself, takes all that has arrived, and delivers it under one hold
of the lock, so that a tree is ticked once for all of it. Not needed any more with an executor that
keeps its wait set. What is delivered, and to whom, is the transports' business.
"""

from __future__ import annotations

import threading
from typing import Any, Protocol

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.waitable import NumberOfEntities, Waitable

from bt_actions.ros.host import host


class Taking(Protocol):
    """A transport, as it is waited for."""

    handle: Any
    """rclpy's low-level action client."""

    def take_data(self) -> None:
        """Take all that has arrived."""

    def deliver(self) -> None:
        """Deliver what was taken."""


class OneWaitable(Waitable):  # type: ignore[misc]  # rclpy is not typed
    """All action transports of a node.

    A client may leave while an executor waits for it: it is destroyed when that wait is over.
    """

    never_waits = True
    """No code of a user's runs in it (once_executor.py)."""

    def __init__(self, node: Node) -> None:
        super().__init__(MutuallyExclusiveCallbackGroup())
        self._node = node
        self._lock = threading.Lock()
        self._members: tuple[Taking, ...] = ()
        self._left: list[Taking] = []  # while somebody waits for them
        self._waits = 0
        self._in_wait: tuple[Taking, ...] = ()
        self._ready: dict[Taking, None] = {}
        node.add_waitable(self)

    def join(self, transport: Taking) -> None:
        """Wait for this one, too."""
        with self._lock:
            transport.handle.__enter__()  # keeps it from being destroyed
            self._members += (transport,)
        self._wake()

    def leave(self, transport: Taking) -> None:
        """Wait for it no more; its client may be destroyed as soon as nobody does."""
        with self._lock:
            self._members = tuple(each for each in self._members if each is not transport)
            self._left.append(transport)
            self._let_go()
        self._wake()

    def _wake(self) -> None:
        if (executor := self._node.executor) is not None:
            executor.wake()

    def _let_go(self) -> None:
        while self._left and not self._waits:
            self._left.pop().handle.__exit__(None, None, None)

    # What rclpy's executor calls

    def __enter__(self) -> None:
        with self._lock:
            self._waits += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._waits -= 1
            self._let_go()

    def get_num_entities(self) -> NumberOfEntities:
        """Return how many subscriptions and clients of services they are."""
        self._in_wait = self._members
        number = len(self._in_wait)
        return NumberOfEntities(num_subs=2 * number, num_clients=3 * number)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Have all of them waited for."""
        for each in self._in_wait:
            each.handle.add_to_waitset(wait_set)

    def is_ready(self, wait_set: Any) -> bool:
        """Whether there is something to take."""
        ready = [each for each in self._in_wait if True in each.handle.is_ready(wait_set)]
        self._ready.update(dict.fromkeys(ready))
        return bool(ready)

    def take_data(self) -> None:
        """Take all that has arrived, and deliver it."""
        ready = []
        while self._ready:
            ready.append(self._ready.popitem()[0])
            ready[-1].take_data()
        with host.lock:
            for each in ready:
                each.deliver()

    async def execute(self, taken: None) -> None:
        """Nothing is left to do."""
