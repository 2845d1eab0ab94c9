"""The thread that receives messages for the actions of a node, whoever spins the node.

An executor builds its wait set anew for each spin, with all else of the node in it, and hands each
message to a thread of its pool. No user's code is called here, so a wait set with the clients of
the actions alone will do. All messages are taken first, then delivered under one hold of the lock,
so that a tree is ticked once for all of them. The transports decide what is delivered, and to whom.
"""

from __future__ import annotations

import atexit
import os
import threading
import weakref

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node

from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.graph import is_valid
from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.utilities.plain_text import raised

AT_MOST = 1_000_000_000
"""Nanoseconds of a wait: nothing tells of a destroyed node."""

_receivers: weakref.WeakSet[Receiver] = weakref.WeakSet()
os.register_at_fork(after_in_child=_receivers.clear)  # their threads are the parent's


class Receiver:
    """The thread of a node's transports; no client is destroyed during its wait."""

    def __init__(self, node: Node) -> None:
        self._node, context = node, node.context
        with context.handle:
            self._guard = _rclpy.GuardCondition(context.handle)
        context.on_shutdown(self._wake)
        _receivers.add(self)
        self._let_go = threading.Condition()
        self._members: tuple[RosTransport, ...] = ()
        self._waits_for: tuple[RosTransport, ...] = ()
        self._thread: threading.Thread | None = None

    def join(self, transport: RosTransport) -> None:
        """Receive for this transport, too."""
        with self._let_go:
            self._members += (transport,)
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._run, name="bt_actions-receive")
                self._thread.daemon = True
                self._thread.start()
        self._wake()

    def leave(self, transport: RosTransport) -> None:
        """Stop receiving for this transport, which may be destroyed then."""
        with self._let_go:
            self._members = tuple(each for each in self._members if each is not transport)
            self._wake()
            while transport in self._waits_for and self._thread and self._thread.is_alive():
                self._let_go.wait()

    def end(self) -> None:
        """Stop receiving, and wait for the end of the thread, if there is one."""
        with self._let_go:
            self._members, thread = (), self._thread
        if thread is not None and thread.is_alive():
            self._wake()
            thread.join()

    def _wake(self) -> None:
        self._guard.trigger_guard_condition()

    def _run(self) -> None:
        while True:
            with self._let_go:
                if not self._members or not is_valid(self._node):
                    self._thread = None
                    break
                self._waits_for = self._members
            try:
                ready = self._take(self._waits_for)
            except RuntimeError:  # rclpy's RCLError: the context was shut down just now
                if is_valid(self._node):
                    raise
                continue
            finally:
                with self._let_go:
                    self._waits_for = ()
                    self._let_go.notify_all()
            with host.lock:
                for each in ready:
                    each.deliver()
        if (executor := self._node.executor) is not None:
            executor.wake()  # rclpy's may miss that a signal has shut its context down

    def _take(self, members: tuple[RosTransport, ...]) -> list[RosTransport]:
        """Wait, take all messages, and return their transports."""
        context = self._node.context.handle
        with context:
            wait_set = _rclpy.WaitSet(2 * len(members), 1, 0, 3 * len(members), 0, 0, context)
        wait_set.clear_entities()
        wait_set.add_guard_condition(self._guard)
        for each in members:
            each.handle.add_to_waitset(wait_set)
        wait_set.wait(AT_MOST)
        ready = [each for each in members if True in each.handle.is_ready(wait_set)]
        for each in ready:
            try:
                each.take_data()
            except Exception as error:  # noqa: BLE001 - the others still want to hear
                log.error(f"a message of an action server could not be processed: {raised(error)}")
        return ready


@atexit.register
def _end_all() -> None:
    """End all threads: one that the interpreter ends in a wait of C++ would abort the process."""
    for each in list(_receivers):
        each.end()
