"""When to tick a tree, and how a run of it ends: one step after another, at times that are given.

Ticks when something has happened, when a deadline falls due, and again at once while each tick
changes a status; a heartbeat covers behaviours that only watch the clock. Whatever ends a run (an
outcome, an interrupt, a timeout, an exception), the tree's goals are drained before it is over. No
thread, no wait, no ROS: a thread steps it, or a test in virtual time.
"""

from __future__ import annotations

import math
import sys
import weakref
from collections.abc import Callable
from numbers import Real
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Duration, Status
from py_trees.trees import BehaviourTree

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.places import culprit_of, path_of, root_of
from bt_actions.events import Observer, Paused, StopWanted
from bt_actions.events.stream import Reader
from bt_actions.messages.interfaces import TwoTypes
from bt_actions.running.goals import RunGoals
from bt_actions.running.telling import TreeError, TreeTeller, UnusableTree
from bt_actions.running.ticking import QUIET_REST, ChangeVisitor, Misbehaviour, tick_once
from bt_actions.running.watchdog import Watchdog
from bt_actions.traffic.drain import Drain, drain
from bt_actions.utilities.plain_text import raised
from bt_actions.utilities.stepping import Done, Sleep
from bt_actions.wiring import backend_of

BURST = 1000
"""Ticks in a row, at most, while each changes a status."""
SLOW = 0.05
"""Seconds for one event from which on an observer is said to be slow."""
LONGEST_WAIT = 3600.0
"""Seconds, at most, between two looks at the tree, whatever the heartbeat is."""


def check_seconds(timeout: float | None) -> None:
    """Raise ValueError where it is no number of seconds."""
    if timeout is not None and not (isinstance(timeout, Real) and timeout == timeout):
        raise ValueError(f"timeout must be a number of seconds, not {timeout!r}")


class _Abandoned(BaseException):
    """Ends a tick."""


class TickLoop:
    """Runs one tree, again and again: `begin`, then `step` until it returns Done or raises.

    Between two steps it wants to be left alone for as long as the first one says, or until `wake`
    is called; a step that comes earlier does no harm.
    """

    def __init__(
        self,
        tree: BehaviourTree,
        node: Any,
        *,
        heartbeat: float = 0.1,
        wake: Callable[[], None] = lambda: None,
        ready: Callable[[], None] = lambda: None,
        check: Callable[[], None] = lambda: None,
        misbehaved: Callable[[], str] = lambda: "",
    ) -> None:
        """Make it; `begin` begins a run.

        Args:
            tree: what is ticked.
            node: what each behaviour is set up with; a Backend may stand for it.
            heartbeat: seconds after which it ticks though nothing has happened; less often where
                nothing that was ticked watches the clock (ticking.py).
            wake: is called on any thread, and in signal handlers, where a step is wanted now.
            ready: is called in each run when the tree is set up, before the first tick.
            check: is called before each tick; what it raises ends the run.
            misbehaved: is asked after each behaviour's tick what that did wrong.
        """
        self.tree, self._heartbeat = tree, heartbeat
        self._backend = backend_of(node)
        self._traffic, self._node, self._wake = self._backend.traffic, node, wake
        self._log = self._traffic.host.log
        self._ready, self._check, self._misbehaved = ready, check, misbehaved
        self.teller = TreeTeller(tree, self._backend)
        self._observers: dict[Reader, Observer] = {}
        self._slow = set[Reader]()
        """Those whose observer is slow, as was said."""
        self.goals = RunGoals(
            self.teller,
            self._traffic.host,
            wake=wake,
            on_change=lambda: self._traffic.host.scheduler.add(self.watchdog),
        )
        self.watchdog = Watchdog(self._traffic, self.goals, self.teller)
        self._nodes = set[Behaviour]()  # of the tree, and set up
        self._pruned = weakref.WeakSet[Behaviour]()  # set up, and not in the tree any more
        self._with_children = dict[Behaviour, list[Behaviour]]()  # as they were set up
        self._doing = "setup"
        self._stop_wanted = self._abandoned = self._pause_wanted = self._paused = False
        self._timeout: float | None = None
        self._deadline = math.inf
        self._now = 0.0
        self._burst = 0
        self._status = Status.INVALID
        self._error: BaseException | None = None
        """What is raised after the drain; also what an observer raised to end the program."""
        self._drain: Drain | None = None

    def observe_events(self, callback: Observer) -> None:
        """Call `callback` with each event, in the step; one that raises is removed."""
        self._observers[self.teller.stream.reader(room=sys.maxsize)] = callback

    # What anybody may ask for, on any thread

    def interrupt(self, now: float, *, abandon: bool = False) -> None:
        """End the run, or the next one; with `abandon`, also the drain. Safe in a handler."""
        self._abandoned |= abandon
        self.watchdog.ends_at = min(self.watchdog.ends_at, now)
        self._stop_wanted = True  # after it: where this run ends in between, the next is stopped
        self._wake()

    def pause(self, wanted: bool) -> None:
        """Stop ticking, or tick on."""
        self._pause_wanted = wanted
        self._wake()

    def is_to_end(self, now: float) -> bool:
        """Whether the run was interrupted, has failed, or is out of time."""
        return self._stop_wanted or self._error is not None or now >= self._deadline

    # A run

    def begin(self, now: float, timeout: float | None = None) -> None:
        """Begin a run on this thread, which is to end within `timeout` seconds."""
        check_seconds(timeout)
        self._timeout, self._deadline = timeout, math.inf if timeout is None else now + timeout
        self._error = self._drain = None
        self._status, self._burst = Status.INVALID, 0
        self._visitor = ChangeVisitor(
            self._set_up_missing, self._after_each, self.teller.changed, self.teller.goes_on
        )
        self.teller.begin()
        self.goals.run_goes_on = True
        self.watchdog.begin(self._deadline)

    def step(self, now: float) -> Sleep | Done[Status]:
        """Do what is to be done now (seconds, steady clock).

        Returns how long there is nothing to do, unless something wakes it; in the end the tree's
        status, INVALID when interrupted. In the end it raises, too: TimeoutError out of time, a
        TreeError where a behaviour raised or had no status, or what else has ended the run.
        """
        self._now = now
        if self._drain is None:
            try:
                if (seconds := self.goals.begun_in(self._go_on)) is not None:
                    return Sleep(seconds)
            except BaseException as error:  # noqa: BLE001 - raised again after the drain
                self.fail(error)
            self._drain = self.goals.begun_in(self._stop)
        return self._wind_up(self._drain)

    def fail(self, error: BaseException) -> None:
        """Have the next step end the run, which raises `error` after the drain.

        Raises it at once where that has begun.
        """
        if self._drain is not None:
            self._error = None  # what has ended the run is not raised again by `shutdown`
            self._rest()
            raise error
        self._error, self._status = error, Status.INVALID

    def _rest(self) -> None:
        self.teller.rest()
        self.teller.stream.stop_is_told = False
        with self._traffic.host.lock:
            self._stop_wanted = self._abandoned = self._pause_wanted = False
            self.goals.run_goes_on = False

    def _go_on(self) -> float | None:
        """Tick if that is wanted; return the seconds until the next look, None at the end."""
        if self._error is not None:
            return None
        if self._visitor not in self.tree.visitors:
            self.tree.visitors.append(self._visitor)
            self._guarded(self._set_up_missing)
            self._ready()
            self.teller.began()
        self._check()
        if self.is_to_end(self._now):
            return None
        self._tell_observers()
        rest = self._heartbeat
        if not self._held():
            goes_on = self._tick() and (self._visitor.may_go_on or self._has_others)
            self._burst = (self._burst + 1) % BURST if goes_on else 0
            if self.watchdog.gave_up:
                return None
            if self.tree.root.status in (Status.SUCCESS, Status.FAILURE):
                self._status = self.tree.root.status
                return None
            if self._burst:
                return 0.0
            rest = self._rests_for()
        return min(rest, LONGEST_WAIT, max(0.0, self._deadline - self._now))

    def _set_up_missing(self) -> None:
        """Set up what was not yet: the tree, in the first run, or what is new in it."""
        tree = self.tree
        while not self._is_as_found():
            self._doing = "setup"
            nodes, found = list[Behaviour](), dict[Behaviour, list[Behaviour]]()
            waiting = [tree.root]
            while waiting:
                node = waiting.pop()
                nodes.append(node)
                if node.children or hasattr(node, "add_child") or node is tree.root:
                    found[node] = list(node.children)
                    waiting += node.children
            by_itself = type(tree).setup is not BehaviourTree.setup and not self._nodes
            if by_itself:
                tree.setup(timeout=Duration.INFINITE, node=self._node)  # and it does more than that
            done = self._nodes | set(self._pruned)
            for node in reversed(nodes):  # children before their parents, as `iterate` has them
                if node not in done:
                    if not by_itself:
                        node.setup(node=self._node)
                    self._nodes.add(node)
            now = set(nodes)
            self._pruned.update(self._nodes - now)
            self._visitor.forget_others(now)
            self._nodes, self._with_children, self._doing = now, found, "tick"
            self.teller.added()

    def _is_as_found(self) -> bool:
        """Whether the tree is as it was set up; takes about 10 ns a behaviour."""
        found = self._with_children
        return self.tree.root in found and [n.children for n in found] == list(found.values())

    def _tick(self) -> bool:
        """Tick once, and tell whether that changed a status."""
        dog = self.watchdog
        dog.seen, dog.ticks_since = False, self._traffic.host.steady()
        try:
            self._guarded(lambda: tick_once(self.tree, self._visitor))
        except _Abandoned:
            pass
        finally:
            if dog.seen:
                dog.tick_returned()
            dog.ticks_since = None
            changed = self._visitor.finish()
            self._tell_observers()
        return changed

    def _after_each(self) -> str:
        if self.watchdog.seen:
            self.watchdog.tick_returned()
        if self.watchdog.ends_at < math.inf and self.watchdog.gives_up():
            raise _Abandoned
        return self._misbehaved()

    @property
    def _has_others(self) -> bool:
        """Whether anybody else is called at each tick."""
        tree = self.tree
        return bool(tree.pre_tick_handlers or tree.post_tick_handlers or len(tree.visitors) > 1)

    def _rests_for(self) -> float:
        """Seconds until the next tick, where nothing happens before."""
        visitor = self._visitor
        watched = self._has_others or visitor.watching
        self.goals.is_watched = watched or bool(self._observers)
        rest = self._heartbeat if watched else max(self._heartbeat, QUIET_REST)
        for due_in in visitor.timed:
            due = due_in()
            if isinstance(due, int | float):
                rest = min(rest, self._heartbeat, max(due, 0.001))
        return rest

    def _held(self) -> bool:
        """Whether the tree is paused; carries a change of that over to goals not sent yet."""
        if self._pause_wanted != self._paused:
            self._paused = self._pause_wanted
            self.teller.stream.add(Paused, self._paused)
            self._traffic.pause(self.goals.not_over, self._paused)
        return self._paused

    def _guarded(self, step: Callable[[], None]) -> None:
        try:
            step()
        except Misbehaviour as error:
            raise self._wrong(TreeError, error.behaviour, str(error)) from None
        except TwoTypes as error:
            raise self._wrong(UnusableTree, culprit_of(error), str(error)) from None
        except Exception as error:
            what = f"{self._doing} raised {raised(error)}"
            raise self._wrong(TreeError, culprit_of(error), what) from error

    def _wrong(self, kind: type[TreeError], culprit: Behaviour | None, what: str) -> TreeError:
        culprit = culprit or self.tree.root
        error = kind(f"{' / '.join(path_of(culprit))}: {what}")
        error.culprit = culprit
        return error

    # Its end

    def _stop(self) -> Drain:
        """Stop what still runs, and begin to drain; say why, where nobody has said it."""
        stream = self.teller.stream
        if self._status is Status.INVALID and self._error is None and not stream.stop_is_told:
            if self._stop_wanted:
                stream.add(StopWanted, "INTERRUPTED", "interrupted")
            else:
                stream.add(StopWanted, "TIMEOUT", f"timeout of {self._timeout:g} s expired")
        if self._visitor in self.tree.visitors:
            self.tree.visitors.remove(self._visitor)
        self._pause_wanted = False
        self._held()
        root = self.tree.root
        if any(node.status is Status.RUNNING for node in root.iterate()):  # not the root, then
            try:
                root.stop(Status.INVALID)
            except BaseException as error:  # noqa: BLE001 - a user's terminate; ours must be reached all the same
                self._raised("terminate of a behaviour raised", error)
                self._let_go(culprit_of(error))
        self.watchdog.ticks_on = None
        return Drain(self._traffic.host, self.goals.not_over)

    def _let_go(self, culprit: Behaviour | None) -> None:
        """Stop what a terminate() that raised has kept from it."""
        for node in self.tree.root.iterate():
            if node.status is Status.RUNNING:
                try:
                    if node is not culprit:
                        node.terminate(Status.INVALID)
                except BaseException as error:  # noqa: BLE001 - the user's: any
                    self._raised(f"terminate of {node.name} raised", error)
                node.status = Status.INVALID

    def _wind_up(self, drain: Drain) -> Sleep | Done[Status]:
        """Drain the tree's goals, and tell."""
        step = drain.step(self._now, hurry=self._abandoned)
        self._tell_observers()
        if isinstance(step, Sleep):
            return step
        self._visitor.stopped()
        self._log.flush()  # who tells of the end tells it last
        self.teller.finished(self._status, self._error, self.goals.unaccounted)
        self._tell_observers()
        timed_out = self._status is Status.INVALID and not self._stop_wanted
        self._rest()
        self.raise_what_ended_it()
        if timed_out:
            raise TimeoutError(f"{self.tree.root.name} did not finish within {self._timeout:g} s")
        return Done(self._status)

    def raise_what_ended_it(self) -> None:
        """Raise what has ended the run, or is to end the program, if anything has; once."""
        error, self._error = self._error, None
        try:
            if error is not None:
                raise error
        finally:
            del error

    def close(self) -> None:
        """Tell what has only now become known of goals; nothing is told after that."""
        self.goals.close()
        self._tell_observers()

    def shutdown(self) -> None:
        """Shut down the tree, and what was pruned, if set up here: else another one may run it."""
        if not self._nodes:
            return
        nodes = list(self.tree.root.iterate())
        ours = [each for each in nodes if isinstance(each, ActionBehaviour)]
        left = {*self._nodes, *self._pruned}.difference(nodes)
        pruned = [each for each in left if root_of(each) in left]  # and is in no other tree
        for shutdown in self.tree.shutdown, *(each.shutdown for each in [*ours, *pruned]):
            try:  # ours must let go though another one raises
                shutdown()
            except Exception as error:  # noqa: BLE001 - the user's: any
                self._raised("shutdown of a behaviour raised", error)
        drain(self._traffic.host, self.goals.not_over)

    # Who is told

    def _tell_observers(self) -> None:
        """Call each observer with what has happened; forget the goals that are over."""
        self.goals.forget()
        steady = self._traffic.host.steady
        for reader, observer in list(self._observers.items()):
            for event in reader.take():
                began = steady()
                try:
                    observer(event)
                except BaseException as error:  # noqa: BLE001 - the run goes on without it
                    self.teller.stream.leave(reader)
                    self._observers.pop(reader, None)
                    self._raised("an observer raised and was removed", error)
                    break
                if (took := steady() - began) > SLOW and reader not in self._slow:
                    self._slow.add(reader)
                    self._log.warning(
                        f"an observer has taken {took:.2f} s for one event; the tree waits for it: "
                        "read `runner.stream` on a thread of your own instead"
                    )

    def _raised(self, what: str, error: BaseException) -> None:
        """Log it, and end the run where it is meant to end the program, as SystemExit is."""
        self._log.error(f"{what}: {raised(error)}")
        if not isinstance(error, Exception):
            self._error = self._error or error
            self._wake()
