"""The runner of a tree, on the thread of the caller (`run`) or on a thread of its own (`start`).

This file has threads, signals, shutdown and the end of the process; running/loop.py has the steps
of a run. ROS comes in through wiring.py, when a runner is made.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
import time
from collections.abc import Callable
from concurrent import futures
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions import wiring
from bt_actions.behaviours.places import path_of, root_of
from bt_actions.events import Observer
from bt_actions.events.stream import Stream
from bt_actions.goals.unaccounted import GoalReport
from bt_actions.running.loop import TickLoop, check_seconds
from bt_actions.running.telling import TreeError
from bt_actions.running.threads import StartedRun, WakeUp
from bt_actions.utilities.plain_text import raised
from bt_actions.utilities.stepping import Done
from bt_actions.utilities.suggest import listing

PATIENCE_AT_EXIT = 30.0
"""Seconds that an ending process gives a run to end: a behaviour may block its tick for ever."""


_runs: set[TreeRunner] = set()
"""The runners with a run in this process; a signal handler can copy the set to a list."""
_runs_change = threading.Condition()


class TreeRunner:
    """A runner of one tree, on a node that is made here or on a given one.

    Args:
        root_or_behaviour_tree: the tree; handlers and visitors of a BehaviourTree are called.
        node: the node to send goals from; without one, context, node and spin thread are made here.
            Runners share them that give no argument but `heartbeat`, and whose trees have, when the
            runner is made, no class but those of bt_actions and py_trees. A node that is in an
            executor is never spun here: its owner spins it.
        executor: "multi" (the default), "single", or an executor; one without nodes is spun here.
        heartbeat: seconds between two ticks without an event; 2 s or more where the ticked nodes
            wait for goals alone, as only others watch the clock.
        namespace: of the node that is made here.
        name: of that node; a name that no other node has where it is left out.
        context: for that node; it is shut down with the node.
        asked_by: the id of the RunTree goal that the runs answer, and that of its caller's run.

    Use a runner as a context manager, or call `shutdown` in the end. A runner is not reentrant, but
    may run again: the tree is set up once. It works in a callback of any other executor.
    """

    def __init__(
        self,
        root_or_behaviour_tree: Behaviour | BehaviourTree,
        *,
        node: Any = None,
        executor: Any = None,
        heartbeat: float = 0.1,
        namespace: str = "",
        name: str = "",
        context: Any = None,
        asked_by: tuple[str, str] = ("", ""),
    ) -> None:
        if not heartbeat > 0.0:
            raise ValueError(f"heartbeat must be more than zero seconds, not {heartbeat!r}")
        tree = root_or_behaviour_tree
        self.tree = tree if isinstance(tree, BehaviourTree) else BehaviourTree(tree)
        self._log = wiring.log()
        self._wake_up = WakeUp()
        self._on_close: list[Callable[[], None]] = []
        self._started: StartedRun | None = None
        self._runs_on: int | None = None
        self._closed = False  # True: no run begins any more
        self._shutting_down = threading.Lock()
        self._is_down = False
        self._pid = os.getpid()
        self._spinner = wiring.spinner(
            self._wake_up.set,
            # A user's class may leave anything on the node in its setup
            may_share=all(
                type(part).__module__.partition(".")[0] in ("bt_actions", "py_trees")
                for part in [self.tree, *self.tree.root.iterate()]
            ),
            node=node,
            executor=executor,
            name=name,
            namespace=namespace,
            context=context,
        )
        self._loop = TickLoop(
            self.tree,
            self._spinner.node,
            heartbeat=heartbeat,
            wake=self._wake_up.set,
            ready=lambda: self._spinner.start(lambda: self._loop.is_to_end(time.monotonic())),
            check=self._check,
            misbehaved=self._spinner.taken_away,
        )
        self._loop.teller.asked_by = asked_by
        self._loop.teller.where = wiring.where(self.node)
        # Before the exit hook of ros/exit.py: a tree that ticks on would send another goal,
        # and a daemon thread in spin() aborts the process that ends beside it.
        atexit.register(self._at_exit)

    @property
    def node(self) -> Any:
        """The ROS node that goals are sent from."""
        return self._spinner.node

    @property
    def executor(self) -> Any:
        """The executor that spins the node; further nodes may be added to it."""
        return self._spinner.executor

    @property
    def unaccounted(self) -> list[GoalReport]:
        """The goals of this tree whose end is UNKNOWN, by now."""
        return self._loop.goals.unaccounted

    @property
    def where(self) -> dict[str, str]:
        """The place of the runs, as `RunBegan` tells; may be added to before a run."""
        return self._loop.teller.where

    @property
    def stream(self) -> Stream:
        """The events of all runs, for readers on threads of their own."""
        return self._loop.teller.stream

    def ticks_since(self) -> float | None:
        """Return when the present tick began, on the steady clock; None between two ticks."""
        return self._loop.watchdog.ticks_since

    @property
    def running(self) -> bool:
        """Whether a run goes on, the drain of its goals included."""
        return self in _runs

    @property
    def future(self) -> futures.Future[Status]:
        """The status of the run that `start` began last, or its error.

        For add_done_callback, which is called on the tree's thread, where `shutdown` and the next
        `start` are allowed, and for `asyncio.wrap_future`. A cancel of the future does nothing:
        `interrupt` ends a run. Raises RuntimeError before the first `start`.
        """
        if self._started is None:
            raise RuntimeError("the tree has not been started, so there is nothing to wait for")
        return self._started.future

    def observe_events(self, callback: Observer) -> None:
        """Call `callback` with each event of a run, on the ticking thread.

        Late news of its goals is told in `shutdown`. An observer that raises is removed, and the
        run goes on; SystemExit and the like end the run, and are raised again when its goals have
        been drained.
        """
        self._loop.observe_events(callback)

    def on_close(self, callback: Callable[[], None]) -> None:
        """Call `callback` in `shutdown`, while nothing spins and the context still lives.

        The callback is the place to destroy further nodes that were added to `executor`.
        """
        self._on_close.append(callback)

    def _close_guests(self) -> None:
        for callback in self._on_close:
            try:
                callback()
            except Exception as error:  # noqa: BLE001 - the others must be closed all the same
                self._log.error(f"closing: {raised(error)}")

    # Running

    def run(self, timeout: float | None = None) -> Status:
        """Run the tree until it succeeds or fails, and return its status; INVALID when interrupted.

        Raises TimeoutError after `timeout` seconds, and TreeError when a behaviour raised or
        returned no status, or the spin thread died; goals are drained first in each case. Raises
        RuntimeError where the tree runs already, here or in another runner, where nobody spins the
        node, and on the thread that has to: in a callback of the node's own executor use `start`
        and `future`. On the main thread and with a node of its own, SIGINT, SIGTERM and SIGHUP take
        effect after the goals were drained.
        """
        if self._spinner.is_here():
            raise _waits_for_itself(
                "run()", "start() the tree, and take its status in a done callback of `future`"
            )
        with self._hear_signals(), self._spinner.replaced():
            self._begin()
            return self._run(timeout)

    def _begin(self) -> None:
        """Take the tree for a run; raises RuntimeError where it is in one."""
        root = root_of(self.tree.root)
        with _runs_change:
            if self.running:
                raise RuntimeError("this tree is running already")
            others = [each for each in _runs if root_of(each.tree.root) is root]
            if not others:
                _runs.add(self)
                return
        here, there = (each.node.get_fully_qualified_name() for each in (self, others[0]))
        raise RuntimeError(
            f"{'/'.join(path_of(self.tree.root))} cannot run in the runner on node {here}: "
            f"{'/'.join(path_of(others[0].tree.root))} is running in the one on node {there}, and "
            "they are parts of one tree"
        )

    def _hear_signals(self) -> contextlib.AbstractContextManager[None]:
        """Hear signals for our own node; a context of the user's has the user's signal handling."""
        if not self._spinner.owns_node:
            return contextlib.nullcontext()
        return wiring.ended_by_signals(self._signalled)

    def _signalled(self, again: bool, ends_process: bool) -> bool:
        """Interrupt the run, and all runs before the process ends; return whether ours cannot end.

        Called in a signal handler.
        """
        for runner in [self, *(list(_runs) if ends_process else [])]:
            runner.interrupt(abandon=again)
        return self._loop.watchdog.is_overdue(time.monotonic())

    def start(self) -> None:
        """Run the tree on a thread of its own; see `wait` and `future`. For use in callbacks.

        A later run may take over the thread, with its `threading.local` data.

        Raises RuntimeError where the tree runs already, here or in another runner.

        A signal that ends the process while neither `wait` nor `shutdown` is on the main thread
        ends it at once, as it does any program, and its goals run on. Only SIGINT, which Python
        turns into an exception, and an orderly end of the main thread drain them. An error of the
        run is logged, too.
        """
        self._begin()
        before, self._started = self._started, StartedRun(self._run, self._log.error)
        try:
            self._started.start()
        except RuntimeError:  # no more threads
            self._started = before
            self._release()
            raise

    def _release(self) -> None:
        self._runs_on = None
        with _runs_change:
            _runs.discard(self)
            _runs_change.notify_all()

    def wait(self, timeout: float | None = None) -> Status:
        """Wait for a tree that was started, and return or raise what `run` would.

        Signals take effect as in `run` while this, or `shutdown`, is on the main thread. Raises
        TimeoutError, with the states of its goals, when the tree is still running after `timeout`
        seconds; the run goes on. Raises RuntimeError before the first `start`, within the run, and,
        without a `timeout`, where `run` does because of the thread.
        """
        check_seconds(timeout)
        future = self.future
        if self._runs_on == threading.get_ident():
            raise RuntimeError("wait() within the run would wait for itself")
        if timeout is None and not future.done() and self._spinner.is_here():
            raise _waits_for_itself("wait()", "take the status in a done callback of `future`")
        with self._hear_signals(), self._spinner.replaced():
            futures.wait([future], None if timeout is None else min(timeout, threading.TIMEOUT_MAX))
        if not future.done():
            goals = [
                f"{handle.name} on {handle.goal.server} is {handle.goal.state.shown}"
                for handle in self._loop.goals.not_over
            ]
            what = f"; {listing(goals, 3)}" if goals else ""
            raise TimeoutError(f"{self.tree.root.name} is still running after {timeout:g} s{what}")
        return future.result()

    def pause(self) -> None:
        """Stop ticking: no new goal starts, running ones finish, and their deadlines hold."""
        self._loop.pause(True)

    def resume(self) -> None:
        """Tick on."""
        self._loop.pause(False)

    def interrupt(self, *, abandon: bool = False) -> None:
        """End the run: cancel and drain its goals. Returns at once; safe in a signal handler.

        An interrupt before a run makes that run return at once. `abandon` stops the wait for goals
        that are being drained; `unaccounted` names them.
        """
        self._loop.interrupt(time.monotonic(), abandon=abandon)

    def shutdown(self) -> None:
        """End a run, and shut down the tree and all that was made here.

        The common parts of runners go with the last of them: objects on their node stay until then.
        Returns at once where another thread shuts down; what an exception cuts short waits no
        longer. Raises RuntimeError on a thread of an executor that is spun here, and within the
        run.
        """
        if self._is_down:
            return
        if self._spinner.would_wait_for_itself():
            raise _waits_for_itself(
                "shutdown()", "call it on another one, or in a done callback of `future`"
            )
        if self._runs_on == threading.get_ident():
            raise RuntimeError("shutdown() within a run would wait for itself; use interrupt()")
        with self._hear_signals():
            self._shut_down(patience=None)
        if self._is_down:
            self._loop.raise_what_ended_it()

    def _at_exit(self) -> None:
        with contextlib.suppress(KeyboardInterrupt), wiring.ended_by_signals(self._signalled):
            self._shut_down(PATIENCE_AT_EXIT)

    def _shut_down(self, patience: float | None) -> None:
        """Shut down; where a run does not end within `patience` seconds, leave all as it is."""
        if os.getpid() != self._pid:
            return  # the child of a fork: the runner is the parent's
        self._closed = True
        atexit.unregister(self._at_exit)
        if not self._shutting_down.acquire(blocking=False):
            return  # another thread shuts down
        try:
            if self.running:
                self.interrupt()
            with _runs_change:
                if not _runs_change.wait_for(lambda: not self.running, patience):
                    return
            self._is_down = True
            if self._started is not None:
                self._started.join()
            guests = self._close_guests if self._on_close else None
            with contextlib.ExitStack() as last:
                last.callback(self._loop.close)
                last.callback(self._spinner.stop, self._wake_up.set, guests)
                self._loop.shutdown()
            self._log.flush()  # the lines are written, whatever becomes of the process
        finally:
            self._shutting_down.release()

    def __enter__(self) -> TreeRunner:
        return self

    def __exit__(self, error: object, *_: object) -> None:
        if error is None or not self._spinner.would_wait_for_itself():
            self.shutdown()  # else the error of run() would be lost

    # A run

    def _run(self, timeout: float | None = None) -> Status:
        try:
            if self._closed:
                raise RuntimeError("this runner has been shut down")
            self._runs_on = threading.get_ident()
            self._loop.begin(time.monotonic(), timeout)
            self._loop.watchdog.see_ticks()
            while True:
                try:
                    step = self._loop.step(time.monotonic())
                    if isinstance(step, Done):
                        return step.result
                    self._wake_up.sleep(step.seconds)
                except BaseException as error:  # noqa: BLE001 - raised again after the drain
                    self._loop.fail(error)
        finally:
            self._release()

    def _check(self) -> None:
        self._spinner.check()
        if error := self._spinner.error:
            raise TreeError(f"the spin thread died: {raised(error)}") from error


def _waits_for_itself(call: str, instead: str) -> RuntimeError:
    return RuntimeError(
        f"{call} would wait for the thread that it is called on, which spins the node: {instead}"
    )
