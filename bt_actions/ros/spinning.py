"""A node of our own and the thread that spins it, with the one order of shutdown that is clean.

Other orders gave errors about invalid handles, segmentation faults, or leaked a thread pool:
executor, spin thread, thread pool, clients, node, context. Users may share one spinner: the first
user makes it, and it stops with the last. Nothing here knows of trees or goals beyond the close of
the node's traffic.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from types import FrameType

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Task

from bt_actions.ros.environment import keep_log
from bt_actions.ros.graph import is_valid
from bt_actions.ros.naming import named_node, open_context
from bt_actions.ros.node_participant import traffic_of
from bt_actions.ros.workarounds import participant
from bt_actions.ros.workarounds.once_executor import OnceExecutor

THREADS = 2
"""Threads of the multi-threaded executor; the interpreter lock does the work, more are no faster.
"""
PATIENCE = 1.0
"""Seconds between two questions to an executor of somebody else's."""
PATIENCE_SPUN = 5.0
"""Seconds without any sign that somebody else spins our node: a loop of theirs may call spin_once
now and then, and a slow callback must be no false alarm.
"""

_number = itertools.count(1)
_shared: weakref.WeakValueDictionary[object, Spinner] = weakref.WeakValueDictionary()
_users_lock = threading.Lock()
os.register_at_fork(after_in_child=_users_lock._at_fork_reinit)  # type: ignore[attr-defined]  # noqa: SLF001 - as threading does


class Spinner:
    """The owner of the parts that the caller does not give: context, node, executor.

    - No node: a context and a node of its own.
    - An executor that holds no node yet, or none: spun here, on a thread of its own.
    - An executor that holds nodes already has an owner, who spins it; it is never spun here.

    `executor` may be ``"multi"`` (the default) or ``"single"``. `context`, for a node that is made
    here, is shut down here as well. `died` is the first user's, and is called on the spin thread at
    its end by an error.
    """

    def __init__(
        self,
        node: Node | None,
        executor: Executor | str | None,
        *,
        name: str = "",
        namespace: str = "",
        context: Context | None = None,
        died: Callable[[], None],
    ) -> None:
        self._users = [died]
        self.error: BaseException | None = None
        """The error that ended the spin thread."""
        self._lock = threading.RLock()
        """Held to start and stop: a call in between may shut down another user."""
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._alive = threading.Event()
        self._asked_at = 0.0
        self.owns_node = node is None
        """Whether the node was made here."""
        given = executor if isinstance(executor, Executor) else None
        if given is None and executor not in (None, "multi", "single"):
            raise ValueError(f"executor must be 'multi', 'single' or an Executor, not {executor!r}")
        if node is not None and node.executor is not None:
            if node not in node.executor.get_nodes():
                node.executor = None  # left behind by an executor that was shut down
            elif given not in (None, node.executor):
                name = node.get_fully_qualified_name()
                raise ValueError(f"node {name} is in another executor than the one given")
            else:
                given = node.executor  # its owner spins it
        self.spins = given is None or not given.get_nodes()
        self._context = context  # to be shut down here
        if context is None and (brought := node or given):
            context = brought.context
        elif context is None:
            context = self._context = Context()
            open_context(context)
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

    @classmethod
    def shared(cls, died: Callable[[], None]) -> Spinner:
        """Return the shared spinner, as long as ROS's settings are the same.

        Return another one where the shared one is broken, and in a callback of its own: its maker
        may be waiting for the callback to end.
        """
        keep_log()  # keep_log may set a variable
        settings = os.getpid(), *sys.argv, *sorted(os.environ.items())
        with _users_lock:
            found = _shared.get(settings)
            if found is None or not found.takes(died):
                found = _shared[settings] = cls(None, None, died=died)
            return found

    def takes(self, died: Callable[[], None]) -> bool:
        """Count another user, who gives `died`; return False for a reason not to."""
        usable = self._users and self.error is None and is_valid(self.node) and not self._left()
        if not usable or self.is_called():
            return False
        self._users.append(died)
        return True

    def start(self, give_up: Callable[[], bool] = lambda: False) -> None:
        """Begin to spin; where somebody else should be spinning, make sure that they do.

        Raises RuntimeError after 5 s without a spin, unless `give_up` says so before.
        """
        if self.spins:
            with self._lock:
                if self._thread is None:
                    self._stopping = False
                    self._thread = threading.Thread(target=self._spin, name="bt_actions-spin")
                    self._thread.daemon = True  # a crash of the main thread must not hang it
                    self._thread.start()
            return
        self._ask_for_life()
        while not self._alive.wait(0.05) and not give_up():
            self._check()

    def check(self) -> None:
        """Make sure now and then that somebody else still spins our node.

        Raises RuntimeError after 5 s without a spin, as where the executor is in callbacks that do
        not return, or the node was taken out of it. A node taken out of our own executor sets
        `error`.
        """
        if not self.spins:
            self._check()
        elif self._left():
            self._dies(self._gone())

    def taken_away(self) -> str:
        """Say that our node has been put into another executor; "" where it has not, in 0.1 us.

        For the ticking thread, after a behaviour has been in charge.
        """
        if not self._moved():
            return ""
        return (
            f"node {self.node.get_fully_qualified_name()} was taken out of its executor in this "
            "tick, as rclpy.spin_until_future_complete(node, ...) and the like do it; return "
            "RUNNING until the future is done instead"
        )

    def is_here(self) -> bool:
        """Return whether this thread spins our node, which stands still while this thread waits."""
        return any(_spins(self.executor, frame) for frame in _frames())

    def is_called(self) -> bool:
        """Return whether an executor that is spun here called this thread."""
        executor = self.executor
        return self.spins and any(_spins(executor, f) or _calls(executor, f) for f in _frames())

    def would_wait_for_itself(self) -> bool:
        """Return whether our executor called this thread, and the one user left is to stop it."""
        return len(self._users) == 1 and self.is_called()

    @contextlib.contextmanager
    def replaced(self) -> Iterator[None]:
        """Let another thread call callbacks while this one, if ours called it, waits."""
        if not isinstance(self.executor, OnceExecutor) or not self.is_called():
            yield
            return
        self.executor.pool.add_threads(1)
        try:
            yield
        finally:
            self.executor.pool.add_threads(-1)

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
        with contextlib.suppress(AttributeError):  # the guard of an executor that is shut down
            self.executor.create_task(self._alive.set)
            self.executor.wake()

    def _moved(self) -> bool:
        executor = self.node.executor
        return executor is not self.executor and executor is not None

    def _left(self) -> bool:
        """Return whether the node was taken out of its executor; a shutdown takes it out, too."""
        return self.node not in self.executor.get_nodes()

    def _gone(self) -> RuntimeError:
        return RuntimeError(
            f"node {self.node.get_fully_qualified_name()} was taken out of its executor, or that "
            "was shut down, while a tree runs; spin a node of your own before its runner is made "
            "(rclpy.spin(node) takes it, too), and shut the runner down first"
        )

    def _spin(self) -> None:
        """Spin until told to stop; a given executor must stay usable, so it is not shut down."""
        try:
            while not self._stopping:
                if self._left():
                    raise self._gone()
                self.executor.spin_once()  # says nothing of an executor that was shut down
                if not self.node.context.ok():
                    raise ExternalShutdownException
        except BaseException as error:  # noqa: BLE001 - a dead spin thread must not go unnoticed
            if not self._stopping:
                self._dies(self._gone() if self._left() else error)

    def _dies(self, error: BaseException) -> None:
        self.error = error
        for died in list(self._users):
            died()

    def stop(self, died: Callable[[], None], before_nodes: Callable[[], None] | None) -> None:
        """Count off the user who gave `died`; with the last one, shut down what is ours.

        The order is the clean one; the user's goals must be drained before. `before_nodes` is
        called when nothing spins, while nodes and context still live.
        """
        with self._lock:
            with _users_lock:
                self._users.remove(died)
            if not self._users:
                self._close(before_nodes)
            elif before_nodes is not None:
                was_spun = self._halt()
                try:
                    before_nodes()
                finally:
                    if was_spun:
                        self.start()

    def _halt(self) -> bool:
        """End the spin thread; return whether there was one."""
        thread, self._thread = self._thread, None
        if thread is None:
            return False
        self._stopping = True
        with contextlib.suppress(Exception):  # a guard without its context
            self.executor.create_task(int)  # does nothing: spin_once returns after it
        thread.join()
        return True

    def _close(self, before_nodes: Callable[[], None] | None) -> None:
        self._halt()
        if self.spins and self._own_executor:
            if isinstance(self.executor, OnceExecutor):
                self.executor.pool.shutdown()  # running work needs the executor's guard
            self.executor.shutdown()
        if self._added and self.node.executor is self.executor:
            self.node.executor = None  # takes it out of the executor, and lets another have it
        if before_nodes is not None:
            before_nodes()
        if self.owns_node:
            self._traffic.destroy()
            if self._context is not None:
                participant.close(self.node)
            else:
                self.node.destroy_node()


def node_beside(node: Node, name: str) -> Node:
    """Return a new node in the same context and namespace; the caller destroys it.

    `--ros-args` are about the other node, whose name this one must not get.
    """
    namespace = node.get_namespace()
    return Node(name, context=node.context, namespace=namespace, use_global_arguments=False)


def _frames() -> Iterator[FrameType]:
    """Yield the frames of this thread."""
    frame: FrameType | None = sys._getframe(1)  # noqa: SLF001 - documented
    while frame is not None:
        yield frame
        frame = frame.f_back


def _spins(executor: Executor, frame: FrameType) -> bool:
    """Return whether a frame is one of `spin`, `spin_once` and the like of the executor."""
    return "spin" in frame.f_code.co_name and frame.f_locals.get("self") is executor


def _calls(executor: Executor, frame: FrameType) -> bool:
    """Return whether the executor calls a callback in this frame."""
    if frame.f_code is not Task.__call__.__code__:
        return False
    return frame.f_locals["self"]._executor() is executor  # noqa: SLF001
