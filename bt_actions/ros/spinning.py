"""A node of our own and the thread that spins it, with the one order of shutdown that is clean.

Other orders gave errors about invalid handles, segmentation faults, or leaked a thread pool:
executor, spin thread, thread pool, clients, node, context. Nothing here knows of trees or goals
beyond closing the node's traffic.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Task

from bt_actions.ros.naming import named_node
from bt_actions.ros.node_participant import traffic_of
from bt_actions.ros.workarounds import participant
from bt_actions.ros.workarounds.once_executor import OnceExecutor

THREADS = 2
"""Of the multi-threaded executor; the interpreter lock does the work, more are no faster."""
PATIENCE = 1.0
"""Seconds between two questions to an executor of somebody else's."""
PATIENCE_SPUN = 5.0
"""Seconds without any sign that somebody else spins our node, where a loop of theirs may call
spin_once now and then, and a slow callback must be no false alarm."""

_number = itertools.count(1)


class Spinner:
    """Owns what the caller did not bring (context, node, executor) and spins what it may.

    - No node: a context and a node of its own.
    - An executor that holds no node yet, or none: spun here, on a thread of its own.
    - An executor that holds nodes already is somebody's, who spins it; it is never spun here.

    `executor` may be ``"multi"`` (the default) or ``"single"``. `context`, for a node that is made
    here, is shut down here as well. `died` is called on the spin
    thread when it ends by an error.
    """

    def __init__(
        self,
        node: Node | None,
        executor: Executor | str | None,
        *,
        name: str = "",
        namespace: str = "",
        context: Context | None = None,
        died: Callable[[BaseException], None] = lambda error: None,
    ) -> None:
        self._died = died
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._alive = threading.Event()
        self._asked_at = 0.0
        self.owns_node = node is None
        """Whether the node was made here."""
        if executor not in (None, "multi", "single") and not isinstance(executor, Executor):
            raise ValueError(f"executor must be 'multi', 'single' or an Executor, not {executor!r}")
        given = executor if isinstance(executor, Executor) else None
        if node is not None and node.executor is not None:
            if node not in node.executor.get_nodes():
                node.executor = None  # left behind by an executor that was shut down
            elif given not in (None, node.executor):
                name = node.get_fully_qualified_name()
                raise ValueError(f"node {name} is in another executor than the one given")
            else:
                given = node.executor  # whose owner spins it
        self.spins = given is None or not given.get_nodes()
        self._context = context  # to be shut down here
        if context is None and (brought := node or given):
            context = brought.context
        elif context is None:
            context = self._context = Context()
            context.init()
        unique = name or f"bt_actions_{os.getpid()}_{next(_number)}"
        try:
            self.node = node or named_node(unique, context, namespace)
        except Exception:
            if self._context is not None:
                self._context.shutdown()
            raise
        self._traffic = traffic_of(self.node)
        self._own_executor = given is None
        if given is not None:
            self.executor: Executor = given
        elif executor == "single":
            self.executor = SingleThreadedExecutor(context=context)
        else:
            self.executor = OnceExecutor(THREADS, context=context)
        self._added = self.node.executor is None
        if self._added:
            self.executor.add_node(self.node)

    def start(self, give_up: Callable[[], bool] = lambda: False) -> None:
        """Begin to spin; where somebody else should be spinning, make sure that they do.

        Raises RuntimeError when nobody does, for 5 s; not where `give_up` says so before.
        """
        if self.spins:
            if self._thread is None:
                self._thread = threading.Thread(target=self._spin, name="bt_actions-spin")
                self._thread.daemon = True  # a crash of the main thread must not hang the process
                self._thread.start()
            return
        self._ask_for_life()
        while not self._alive.wait(0.05) and not give_up():
            self._check()

    def check(self) -> None:
        """Make sure now and then that whoever spins our node still does.

        Raises RuntimeError when nobody has for 5 s, as where the executor is in callbacks that do
        not return, or the node was taken out of it. Out of one that is spun here: calls `died`.
        """
        if not self.spins:
            self._check()
        elif self._left():
            self._died(self._gone())

    def taken_away(self) -> str:
        """Say that our node has been put into another executor; empty where it has not, in 0.1 us.

        For the thread that ticks, as soon as a behaviour has been in charge.
        """
        if not self._moved():
            return ""
        return (
            f"node {self.node.get_fully_qualified_name()} was taken out of its executor in this "
            "tick, as rclpy.spin_until_future_complete(node, ...) and the like do it; return "
            "RUNNING until the future is done instead"
        )

    def is_here(self) -> bool:
        """Whether our node is not spun while this thread waits.

        This thread spins it, or, where it is spun by us, was called by the executor.
        """
        frame: FrameType | None = sys._getframe()  # noqa: SLF001 - documented
        while frame is not None:
            if _spins(self.executor, frame) or (self.spins and _calls(self.executor, frame)):
                return True
            frame = frame.f_back
        return False

    def _check(self) -> None:
        if self._moved() or getattr(self.executor, "_is_shutdown", False):  # rclpy's name of it
            raise self._gone()
        now, left = time.monotonic(), self._left()  # rclpy.spin_once(node) puts it in and out
        if self._alive.is_set() and not left:
            if now - self._asked_at >= PATIENCE:
                self._ask_for_life()
        elif now - self._asked_at >= PATIENCE_SPUN and (left or not self._alive.wait(PATIENCE)):
            # that wait: where this whole process stood still, they need a moment, too
            raise RuntimeError(
                f"node {self.node.get_fully_qualified_name()} is in an executor that nobody spins, "
                f"or that is in callbacks which have not returned for {PATIENCE_SPUN:g} s; spin it "
                "on another thread while the tree runs, or leave the executor out"
            )

    def _ask_for_life(self) -> None:
        self._alive = threading.Event()
        self._asked_at = time.monotonic()
        with contextlib.suppress(AttributeError):  # of the guard of an executor that is shut down
            self.executor.create_task(self._alive.set)
            self.executor.wake()

    def _moved(self) -> bool:
        executor = self.node.executor
        return executor is not self.executor and executor is not None

    def _left(self) -> bool:
        """Whether the node was taken out of its executor; shut down, that holds none."""
        return self.node not in self.executor.get_nodes()

    def _gone(self) -> RuntimeError:
        return RuntimeError(
            f"node {self.node.get_fully_qualified_name()} was taken out of its executor, or that "
            "was shut down, while a tree runs; spin a node of your own before its runner is made "
            "(rclpy.spin(node) takes it, too), and shut the runner down first"
        )

    def _spin(self) -> None:
        """Spin until told to stop; an executor that was given must stay usable, so no shutdown."""
        try:
            while not self._stopping and not self._left():
                self.executor.spin_once()  # says nothing of an executor that was shut down
                if not self.node.context.ok():
                    raise ExternalShutdownException
        except BaseException as error:  # noqa: BLE001 - a dead spin thread must not go unnoticed
            if not self._stopping:
                self._died(self._gone() if self._left() else error)
        else:
            if not self._stopping:
                self._died(self._gone())

    def stop(self, before_nodes: Callable[[], None]) -> None:
        """Shut down what is ours, in the clean order; goals must be drained before.

        `before_nodes` is called when nothing spins any more, while nodes and context still live.
        """
        if self.spins:
            self._stopping = True
            if self._thread is not None:
                with contextlib.suppress(Exception):  # of a guard whose context is gone
                    self.executor.create_task(int)  # does nothing: spin_once returns after it
                self._thread.join()
            if self._own_executor:
                if isinstance(self.executor, OnceExecutor):
                    self.executor.finish()  # what it still runs needs the executor's guard
                self.executor.shutdown()
        if self._added and self.node.executor is self.executor:
            self.node.executor = None  # takes it out of the executor, and lets another have it
        before_nodes()
        if self.owns_node:
            self._traffic.destroy()
            if self._context is not None:
                participant.close(self.node, self._context)
            else:
                self.node.destroy_node()


def node_beside(node: Node, name: str) -> Node:
    """Return a new node in the same context; the caller destroys it.

    What `--ros-args` says is about the other one, whose name it may not get too.
    """
    return Node(name, context=node.context, use_global_arguments=False)


def _spins(executor: Executor, frame: FrameType) -> bool:
    """Whether a frame is one of `spin`, `spin_once` and the like of the executor."""
    return "spin" in frame.f_code.co_name and frame.f_locals.get("self") is executor


def _calls(executor: Executor, frame: FrameType) -> bool:
    """Whether it is in a frame that the executor calls a callback."""
    if frame.f_code is not Task.__call__.__code__:
        return False
    return frame.f_locals["self"]._executor() is executor  # noqa: SLF001
