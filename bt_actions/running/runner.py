"""Runs a tree to its end: ticks when something happened and when a deadline falls due.

One tick at a time, on one thread (the caller's in `run`, one of its own after `start`). It does not
poll; a heartbeat covers behaviours that only watch the clock. Whatever ends a run (an outcome, an
interrupt, a timeout, an exception), the tree's goals are drained before it is over. ROS comes in
through ros/ and only when a runner is made.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent import futures
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour
from py_trees.common import Duration, Status
from py_trees.trees import BehaviourTree

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.events import Event, GoalChanged, NodeChanged, Observer, TreeFinished, TreeStarted
from bt_actions.goals.policy import End, Outcome
from bt_actions.running.ticking import ChangeVisitor, Misbehaviour, Patience, SetUp, tick_once
from bt_actions.utilities.places import culprit_of, path_of, root_of
from bt_actions.utilities.plain_text import raised

if TYPE_CHECKING:
    from bt_actions.traffic.shared import Change, GoalHandle

BURST = 1000
"""Ticks in a row, at most, while each changes a status."""
LONGEST_WAIT = 3600.0
"""Seconds, at most, between two looks at the tree, whatever `heartbeat` is."""
PATIENCE_AT_EXIT = 30.0
"""Seconds that a process that ends gives a run to end: a behaviour may block its tick for ever."""


_runs: set[TreeRunner] = set()
"""All that go on in this process; a list of them can be made in a signal handler."""
_beginning = threading.Lock()


class TreeError(Exception):
    """A behaviour raised or had no status, or the spin thread died; the goals have been drained."""


@dataclass(frozen=True, slots=True)
class GoalReport:
    """A goal that nobody can account for: it may still be running."""

    name: str
    server: str
    goal_id: str
    outcome: Outcome | None
    reason: str


class TreeRunner:
    """Runs one tree, on a node of its own or on one that is given.

    Args:
        root_or_behaviour_tree: what to run; of a BehaviourTree, handlers and visitors are called.
        node: to send goals from; without one, context, node and spin thread are made here. A node
            that is in an executor is never spun here: its owner spins it.
        executor: "multi" (the default), "single", or an executor; one without nodes is spun here.
        heartbeat: seconds after which the tree is ticked though nothing has happened.
        namespace: of the node that is made here.
        name: of that node; one that no other has where it is left out.
        context: for that node; it is shut down with it.

    Use it as a context manager, or call `shutdown` in the end. Not reentrant, but may run again:
    the tree is set up once. It works in a callback of anybody else's executor.
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
    ) -> None:
        from bt_actions.ros.spinning import Spinner

        if not heartbeat > 0.0:
            raise ValueError(f"heartbeat must be more than zero seconds, not {heartbeat!r}")
        tree = root_or_behaviour_tree
        self.tree = tree if isinstance(tree, BehaviourTree) else BehaviourTree(tree)
        self.heartbeat = heartbeat
        self._wakes: queue.SimpleQueue[None] = queue.SimpleQueue()  # put() is safe in a handler
        self._awake = False
        self._changes: deque[Change] = deque()
        self._observers: list[Observer] = []
        self._on_close: list[Callable[[], None]] = []
        self._set_up = SetUp()
        self._doing = "setup"
        self._stop_wanted = False
        self._abandoned = False
        self._pause_wanted = False
        self._paused = False
        self._spin_error: BaseException | None = None
        self._leaving: BaseException | None = None
        """What an observer, or a terminate(), raised to end the program: after the drain."""
        self._thread: threading.Thread | None = None
        self._future: futures.Future[Status] | None = None
        self._is_heard = True  # somebody has asked what became of it
        self._running = threading.Lock()
        self._runs_on: int | None = None
        self._closed = False  # no run begins any more
        self._shutting_down = threading.Lock()
        self._is_down = False
        self._pid = os.getpid()
        self._handles: set[GoalHandle] = set()
        self._patience = Patience(_warn)  # on its behalf the ticks of ours begin goals
        self._spinner = Spinner(
            node, executor, name=name, namespace=namespace, context=context, died=self._spin_died
        )
        self._visitor = ChangeVisitor(self._set_up_rest, self._spinner.taken_away)
        self._traffic = _traffic_of(self._spinner.node)
        self._traffic.observe(self._note)
        # Before the exit hook of traffic/traffic.py: a tree that ticks on would send another goal,
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
        return [
            GoalReport(
                handle.name,
                handle.goal.server,
                handle.goal.id.hex(),
                handle.goal.outcome,
                f"{handle.goal.reason}{handle.goal.cancel_said}",
            )
            for handle in list(self._handles)
            if handle.goal.end is End.UNKNOWN
            and (handle.goal.outcome is not None or not self._running.locked())
        ]

    @property
    def running(self) -> bool:
        """Whether a run goes on, the drain of its goals included."""
        return self._running.locked()

    @property
    def future(self) -> futures.Future[Status]:
        """The status of the run that `start` began last, or what it raised.

        For add_done_callback, which is called on the tree's thread, where `shutdown` and the next
        `start` are allowed, and for `asyncio.wrap_future`. To cancel it does nothing: `interrupt`
        does. Raises RuntimeError before the first `start`.
        """
        if self._future is None:
            raise RuntimeError("there is no future: the tree has not been started")
        self._is_heard = True
        return self._future

    def observe(self, callback: Observer) -> None:
        """Call `callback` with each event of a run, on the ticking thread.

        What becomes known of its goals in `shutdown` is told there.
        One that raises is removed, and the run goes on; SystemExit and the like end it, and are
        raised again when its goals have been drained.
        """
        self._observers.append(callback)

    def on_close(self, callback: Callable[[], None]) -> None:
        """Call `callback` in `shutdown`, when nothing spins any more and the context still lives.

        The place to destroy further nodes that were added to `executor`.
        """
        self._on_close.append(callback)

    def _close_guests(self) -> None:
        for callback in self._on_close:
            try:
                callback()
            except Exception as error:  # noqa: BLE001 - the rest must be closed all the same
                _error(f"closing: {raised(error)}")

    # Running

    def run(self, timeout: float | None = None) -> Status:
        """Run the tree until it succeeds or fails, and return which; INVALID when interrupted.

        Raises TimeoutError after `timeout` seconds, TreeError when a behaviour raised or returned
        no status, or the spin thread died (goals are drained first in each case), and RuntimeError
        where the tree runs already, here or in another runner, where nobody spins the node, and on
        the thread that has to: in a callback of the node's own executor use `start` and `future`.
        On the main thread and with a node of its own, SIGINT, SIGTERM and SIGHUP take effect after
        the goals were drained.
        """
        if self._spinner.is_here():
            raise RuntimeError(
                "run() would wait for the thread that it is called on, which spins the node: "
                "start() the tree, and take its status in a done callback of `future`"
            )
        self._begin()
        try:
            with self._mind_signals():
                return self._run(timeout)
        finally:
            self._release()

    def _begin(self) -> None:
        """Take the tree for a run; raises RuntimeError where it is in one."""
        if not self._running.acquire(blocking=False):
            raise RuntimeError("this tree is running already")
        root = root_of(self.tree.root)
        with _beginning:
            others = [each for each in list(_runs) if root_of(each.tree.root) is root]
            if not others:
                _runs.add(self)
                return
        self._running.release()
        here, there = (each.node.get_fully_qualified_name() for each in (self, others[0]))
        raise RuntimeError(
            f"{'/'.join(path_of(self.tree.root))} cannot run in the runner on node {here}: "
            f"{'/'.join(path_of(others[0].tree.root))} is running in the one on node {there}, and "
            "they are parts of one tree"
        )

    def _mind_signals(self) -> contextlib.AbstractContextManager[None]:
        """With a node of the user's, its context's signal handling is the user's as well."""
        if not self._spinner.owns_node:
            return contextlib.nullcontext()
        return self._ended_by_signals()

    def _ended_by_signals(self) -> contextlib.AbstractContextManager[None]:
        from bt_actions.ros.signals import ended_by_signals
        from bt_actions.traffic.traffic import close_process

        return ended_by_signals(self._signalled, close_process)

    def _signalled(self, again: bool, ends_process: bool) -> bool:
        """Interrupt the run, and all of them before the process ends; tell whether ours cannot end.

        Called in a signal handler.
        """
        for runner in [self, *(list(_runs) if ends_process else [])]:
            runner.interrupt(abandon=again)
        return self._patience.is_over

    def start(self) -> None:
        """Run the tree on a thread of its own; see `wait` and `future`. For use in callbacks.

        Raises RuntimeError where the tree runs already, here or in another runner.

        A signal that ends the process while neither `wait` nor `shutdown` is on the main thread
        ends it at once, as it does any program, and its goals run on: only SIGINT, which Python
        turns into an exception, and what ends the main thread in good order, drains them.
        """
        self._begin()
        self._tell_unheard()
        before = self._thread, self._future
        future = self._future = futures.Future[Status]()
        future.set_running_or_notify_cancel()
        self._thread = threading.Thread(
            target=self._run_started, args=(future,), name="bt_actions-tree"
        )
        self._thread.daemon = True  # the exit hook of traffic/traffic.py drains what it leaves
        self._is_heard = False
        try:
            self._thread.start()
        except RuntimeError:  # there can be no more threads
            self._is_heard, (self._thread, self._future) = True, before
            self._release()
            raise

    def _run_started(self, future: futures.Future[Status]) -> None:
        try:
            status = self._run(None)
        except BaseException as error:  # noqa: BLE001 - raised again by wait()
            self._release()
            future.set_exception(error)
        else:
            self._release()
            future.set_result(status)

    def _tell_unheard(self) -> None:
        """Tell in the log what a run raised that nobody has asked about."""
        if not self._is_heard and self._future is not None:
            if error := self._future.exception():
                _error(f"the tree that was started raised {raised(error)}")
            self._is_heard = True

    def _release(self) -> None:
        from bt_actions.traffic.shared import lock

        self._stop_wanted = self._abandoned = self._pause_wanted = False
        try:
            with lock:  # under which _note() is called
                self._runs_on = None
                late = {change.handle for change in list(self._changes)}  # since it last looked
                self._handles |= {handle for handle in late if self._has_left(handle)}
        finally:
            _runs.discard(self)
            self._running.release()

    def wait(self, timeout: float | None = None) -> Status:
        """Wait for a tree that was started, and return or raise what `run` would.

        Signals take effect as in `run` while this, or `shutdown`, is on the main thread.
        Raises TimeoutError, which says what its goals do, when it is still running after `timeout`
        seconds; it goes on. Raises RuntimeError before the first `start`, within the run, and,
        without a `timeout`, where `run` does because of the thread.
        """
        future = self._future
        if future is None:
            raise RuntimeError("nothing to wait for: the tree has not been started")
        _check_seconds(timeout)
        if self._runs_on == threading.get_ident():
            raise RuntimeError("wait() within the run would wait for itself")
        if timeout is None and not future.done() and self._spinner.is_here():
            raise RuntimeError(
                "wait() would wait for the thread that it is called on, which spins the node: "
                "take the status in a done callback of `future`"
            )
        with self._mind_signals():
            futures.wait([future], None if timeout is None else min(timeout, threading.TIMEOUT_MAX))
        if not future.done():
            goals = [
                f"{handle.name} on {handle.goal.server} is {handle.goal.state.value}"
                for handle in list(self._handles)
                if not handle.is_over
            ]
            what = f"; {', '.join(goals)}" if goals else ""
            raise TimeoutError(f"{self.tree.root.name} is still running after {timeout:g} s{what}")
        self._is_heard = True
        return future.result()

    def pause(self) -> None:
        """Stop ticking: no new goal starts, running ones finish, and their deadlines hold."""
        self._pause_wanted = True
        self._wake()

    def resume(self) -> None:
        """Tick on."""
        self._pause_wanted = False
        self._wake()

    def interrupt(self, *, abandon: bool = False) -> None:
        """End the run: cancel and drain its goals. Returns at once; safe in a signal handler.

        Before a run it makes that run return at once.

        With `abandon`, stop waiting for goals that are being drained; `unaccounted` tells which.
        """
        self._abandoned = self._abandoned or abandon
        self._patience.end_now()
        self._stop_wanted = True  # after it: where this run ends in between, the next is stopped
        self._wake()

    def catch_up(self) -> None:
        """Tell the observers, on this thread, what became of goals since a tick does not return.

        For who leaves without waiting for it; does nothing unless the run was to end by then.
        """
        if self._patience.gave_up:
            self._flush()

    def shutdown(self) -> None:
        """End the run if there is one, and shut down the tree and all that was made here.

        Returns at once where another thread is at it. What an exception cuts short waits no longer.
        Raises RuntimeError on a thread of an executor that is spun here, and within the run.
        """
        if self._is_down:
            return
        if self._spins_here():
            raise RuntimeError(
                "shutdown() would wait for the thread that it is called on, which spins the node: "
                "call it on another one, or in a done callback of `future`"
            )
        if self._runs_on == threading.get_ident():
            raise RuntimeError("shutdown() within a run would wait for itself; use interrupt()")
        with self._mind_signals():
            self._shut_down(patience=-1.0)
        if self._is_down and self._leaving is not None:
            leaving, self._leaving = self._leaving, None
            raise leaving

    def _spins_here(self) -> bool:
        return self._spinner.spins and self._spinner.is_here()

    def _at_exit(self) -> None:
        with contextlib.suppress(KeyboardInterrupt), self._ended_by_signals():
            self._shut_down(PATIENCE_AT_EXIT)

    def _shut_down(self, patience: float) -> None:
        """Shut down; where a run does not end within `patience` seconds, leave all as it is."""
        if os.getpid() != self._pid:
            return  # the child of a fork: all of this is the parent's
        self._closed = True
        atexit.unregister(self._at_exit)
        if not self._shutting_down.acquire(blocking=False):
            return  # somebody else is at it
        try:
            if self._running.locked():
                self.interrupt()
            if not self._running.acquire(timeout=patience):
                return
            self._running.release()
            self._is_down = True
            self._take_down()
            _flush_log()  # what was said is written, whatever becomes of the process
        finally:
            self._shutting_down.release()

    def _take_down(self) -> None:
        thread, self._thread = self._thread, None
        if thread is not None and thread is not threading.current_thread():  # a done callback
            thread.join()
        self._tell_unheard()
        try:
            if self._set_up.has_begun:  # else it is not ours: another runner may run it
                self.tree.shutdown()
        except Exception as error:  # noqa: BLE001 - the user's: any
            _error(f"shutdown of a behaviour raised: {raised(error)}")
            for behaviour in self.tree.root.iterate():  # ours must let go all the same
                if isinstance(behaviour, ActionBehaviour):
                    with contextlib.suppress(Exception):
                        behaviour.shutdown()
        finally:
            try:
                self._spinner.stop(self._close_guests)
            finally:
                self._traffic.unobserve(self._note)
                self._flush()  # what has only now become known of goals

    def __enter__(self) -> TreeRunner:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is None or not self._spins_here():  # else what run() has said would be lost
            self.shutdown()

    # The loop

    def _run(self, timeout: float | None) -> Status:
        if self._closed:
            raise RuntimeError("this runner has been shut down")
        _check_seconds(timeout)
        deadline = None if timeout is None else time.monotonic() + timeout
        self._leaving = None
        self._visitor.forget()
        self.tree.visitors.append(self._visitor)
        self._runs_on = threading.get_ident()
        self._patience.begin(deadline)
        try:
            self._guarded(self._set_up_all)  # clients are made before anything spins
            self._spinner.start(lambda: self._stop_wanted or _past(deadline))
            self._emit(TreeStarted(time.monotonic()))
            status = self._tick_until(deadline)
        except BaseException:
            self._end(Status.INVALID)
            self._leaving = None
            raise
        finally:
            self.tree.visitors.remove(self._visitor)
        self._end(status)
        leaving, self._leaving = self._leaving, None
        if leaving is not None:
            raise leaving
        if status is Status.INVALID and timeout is not None and not self._stop_wanted:
            raise TimeoutError(f"{self.tree.root.name} did not finish within {timeout:g} s")
        return status

    def _set_up_all(self) -> None:
        """Set up the tree, in the first run, or what is new in it."""
        self._doing = "setup"
        tree = self.tree
        if type(tree).setup is not BehaviourTree.setup and not self._set_up.has_begun:
            tree.setup(timeout=Duration.INFINITE, node=self.node)  # and it does more than that
            for _ in self._set_up.missing(tree.root):
                pass
        for behaviour in self._set_up.missing(tree.root):
            behaviour.setup(node=self.node)
        self._doing = "tick"

    def _set_up_rest(self) -> None:
        if not self._set_up.is_complete(self.tree.root):
            self._set_up_all()

    def _tick_until(self, deadline: float | None) -> Status:
        """Tick until the tree has a status; INVALID when interrupted or out of time."""
        wait = 0.0
        while True:
            with contextlib.suppress(queue.Empty):
                self._wakes.get(timeout=wait) if wait > 0.0 else self._wakes.get_nowait()
            self._awake = False
            self._spinner.check()
            if self._spin_error is not None:
                raise TreeError(
                    f"the spin thread died: {raised(self._spin_error)}"
                ) from self._spin_error
            if self._stop_wanted or _past(deadline):
                return Status.INVALID
            self._flush()
            if self._held():
                wait = min(self.heartbeat, LONGEST_WAIT)
            else:
                status = self._tick(deadline)
                if self._patience.gave_up:
                    return Status.INVALID
                if status in (Status.SUCCESS, Status.FAILURE):
                    return status
                wait = min([self.heartbeat, LONGEST_WAIT, *self._dues()])
            if deadline is not None:
                wait = min(wait, max(0.0, deadline - time.monotonic()))

    def _tick(self, deadline: float | None) -> Status:
        """Tick; again at once while each tick changes a status, and nobody wants it to stop."""
        for _ in range(BURST):
            self._visitor.begin()
            try:
                with self._traffic.begun_by(self._patience):
                    self._guarded(lambda: tick_once(self.tree))
            finally:
                changed = self._visitor.finish()
                self._flush()
                self._tell(changed)
            status = self.tree.root.status
            if not changed or status is not Status.RUNNING:
                return status
            if self._stop_wanted or self._pause_wanted or _past(deadline):
                return status
        return self.tree.root.status

    def _tell(self, changes: list[tuple[Behaviour, Status]]) -> None:
        for node, status in changes:
            message = node.feedback_message
            self._emit(NodeChanged(time.monotonic(), path_of(node), node, status, message))

    def _dues(self) -> list[float]:
        """The deadlines that running behaviours have of their own, as seconds from now."""
        dues = []
        for node in self._visitor.running:
            due_in = getattr(node, "due_in", None)
            due = due_in() if callable(due_in) else None
            if isinstance(due, int | float):
                dues.append(max(due, 0.001))
        return dues

    def _held(self) -> bool:
        """Whether the tree is paused; carries a change of that over to goals not sent yet."""
        if self._pause_wanted != self._paused:
            self._paused = self._pause_wanted
            handles = list(self._handles)
            (self._traffic.pause if self._paused else self._traffic.resume)(handles)
        return self._paused

    def _end(self, status: Status) -> None:
        """Stop what still runs, drain the tree's goals, and tell."""
        root = self.tree.root
        if self._paused:
            self._traffic.resume(list(self._handles))
            self._paused = False
        self._flush()  # a goal may have begun in a tick that raised
        if any(node.status is Status.RUNNING for node in root.iterate()):  # not the root, then
            try:
                root.stop(Status.INVALID)
            except BaseException as error:  # noqa: BLE001 - a user's terminate; ours must be reached all the same
                _error(f"terminate of a behaviour raised: {raised(error)}")
                self._leave_with(error)
                self._let_go(culprit_of(error))
        self._patience.end()
        _drain(self._handles, self._hurry)
        self._flush()
        self._tell(self._visitor.stopped())
        self._handles = {handle for handle in self._handles if not handle.is_over}
        _flush_log()  # who tells of the end tells it last
        self._emit(TreeFinished(time.monotonic(), status))

    def _let_go(self, culprit: Behaviour | None) -> None:
        """Stop what a terminate() that raised has kept from it, and interrupt every action."""
        for node in self.tree.root.iterate():
            if node.status is Status.RUNNING:
                try:
                    if node is not culprit:
                        node.terminate(Status.INVALID)
                except BaseException as error:  # noqa: BLE001 - the user's: any
                    _error(f"terminate of {node.name} raised: {raised(error)}")
                    self._leave_with(error)
                node.status = Status.INVALID
            if isinstance(node, ActionBehaviour):
                ActionBehaviour.terminate(node, Status.INVALID)

    def _hurry(self) -> bool:
        self._flush()
        return self._abandoned

    def _guarded(self, step: Callable[[], None]) -> None:
        try:
            step()
        except Exception as error:
            culprit = culprit_of(error)
            where = f"{'/'.join(path_of(culprit))}" if culprit is not None else self.tree.root.name
            if isinstance(error, Misbehaviour):
                raise TreeError(f"{where}: {error}") from None
            what = f"{self._doing} raised {type(error).__name__}: {error}"
            raise TreeError(f"{where}: {what}") from error

    # Who wakes and who is told

    def _wake(self) -> None:
        if not self._awake:
            self._awake = True
            self._wakes.put(None)

    def _spin_died(self, error: BaseException) -> None:
        self._spin_error = error
        self._wake()

    def _note(self, change: Change | None) -> None:
        """Take note of a change of a goal of our node; called under the lock of the traffic.

        Between two runs only of those that a run of ours has left.
        """
        if self._runs_on is None:
            if change is None or not self._has_left(change.handle):
                return
            self._handles.add(change.handle)  # a duplicate is news
        if change is not None:
            self._changes.append(change)
        self._wake()

    def _has_left(self, handle: GoalHandle) -> bool:
        return handle in self._handles or (handle.begun_by is self._patience and not handle.is_over)

    def _flush(self) -> None:
        while True:
            try:
                change = self._changes.popleft()
            except IndexError:
                return
            handle = change.handle
            if not self._is_ours(handle):
                continue  # another tree on the same node
            self._handles.add(handle)
            if handle.owner is not None:  # else its leaf was thrown away since
                self._emit(
                    GoalChanged(
                        time.monotonic(),
                        handle.owner,
                        change.state.value,
                        handle.attempt,
                        change.outcome,
                        change.end,
                        change.reason,
                        handle.goal.id.hex(),
                    )
                )
            if handle.is_over:
                self._handles.discard(handle)
            elif handle.goal.lost:  # and what was lost longer ago is over by now
                self._handles -= {each for each in list(self._handles) if each.is_over}

    def _is_ours(self, handle: GoalHandle) -> bool:
        """Whether the goal is this tree's: begun in a tick of it, wherever its leaf is by now."""
        if handle in self._handles or handle.begun_by is self._patience:
            return True
        return handle.owner is not None and root_of(handle.owner) is self.tree.root

    def _emit(self, event: Event) -> None:
        for observer in list(self._observers):
            try:
                observer(event)
            except BaseException as error:  # noqa: BLE001 - the run goes on without it
                self._observers.remove(observer)
                _error(f"an observer raised and was removed: {raised(error)}")
                self._leave_with(error)

    def _leave_with(self, error: BaseException) -> None:
        """End the run, and then raise what is meant to end the program, as SystemExit is."""
        if not isinstance(error, Exception):
            self._leaving, self._stop_wanted = error, True
            self._wake()


def _check_seconds(timeout: float | None) -> None:
    if timeout is not None and timeout != timeout:
        raise ValueError(f"timeout must be a number of seconds, not {timeout!r}")


def _past(deadline: float | None) -> bool:
    return deadline is not None and time.monotonic() >= deadline


def _warn(message: str) -> None:
    from bt_actions.ros.log import log

    log.warning(message)


def _error(message: str) -> None:
    from bt_actions.ros.log import log

    log.error(message)


def _flush_log() -> None:
    from bt_actions.ros.log import log

    log.flush()


def _traffic_of(node: Any) -> Any:
    from bt_actions.traffic.traffic import Traffic

    return Traffic.of(node)


def _drain(handles: set[GoalHandle], hurry: Any) -> None:
    from bt_actions.traffic.drain import drain

    drain(list(handles), hurry)
