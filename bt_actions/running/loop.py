"""The loop of a tree: its ticks, and the end of a run, one step after another at given times.

The loop ticks after an event, at a deadline, and again at once while each tick changes a status; a
heartbeat covers behaviours that only watch the clock. At the end of a run (by an outcome, an
interrupt, a timeout, an exception) the tree's goals are drained before the run is over. No thread,
no wait, no ROS: a thread steps the loop, or a test in virtual time.
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
"""Seconds for one event from which on an observer counts as slow."""
LONGEST_WAIT = 3600.0
"""Seconds, at most, between two looks at the tree, whatever the heartbeat is."""


def check_seconds(timeout: float | None) -> None:
    """Raise ValueError for a timeout that is no number of seconds."""
    if timeout is not None and not (isinstance(timeout, Real) and timeout == timeout):
        raise ValueError(f"timeout must be a number of seconds, not {timeout!r}")


class _Abandoned(BaseException):
    """The exception that ends a tick."""


class TickLoop:
    """The loop of one tree, for run after run.

    `begin`, then `step` until it returns Done or raises.

    Between two steps the loop needs no call for as long as the first one says, or until `wake` is
    called; an earlier step does no harm.
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
        misbehaved: Callable[[], str] | None = None,
    ) -> None:
        """Make the loop; `begin` begins a run.

        Args:
            tree: the tree to tick.
            node: the node for each behaviour's setup; a Backend may stand for it.
            heartbeat: seconds between two ticks without an event; more where no ticked behaviour
                watches the clock (ticking.py).
            wake: called on any thread, and in signal handlers, where a step is wanted now.
            ready: called in each run when the tree is set up, before the first tick.
            check: called before each tick; an error there ends the run.
            misbehaved: asked after each behaviour's tick for a fault of it.
        """
        self.tree, self._heartbeat = tree, heartbeat
        self._backend = backend_of(node)
        self._traffic, self._node, self._wake = self._backend.traffic, node, wake
        self._log = self._traffic.host.log
        self._ready, self._check, self._misbehaved = ready, check, misbehaved
        self.teller = TreeTeller(tree, self._backend)
        self._observers: dict[Reader, Observer] = {}
        self._slow = set[Reader]()
        """Readers whose observer was said to be slow."""
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
        """The error to raise after the drain; also that of an observer that ends the program."""
        self._drain: Drain | None = None

    def observe_events(self, callback: Observer) -> None:
        """Call `callback` with each event, in the step; an observer that raises is removed."""
        self._observers[self.teller.stream.reader(room=sys.maxsize)] = callback

    # Requests, on any thread

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
        """Return whether the run was interrupted, has failed, or is out of time."""
        return self._stop_wanted or self._error is not None or now >= self._deadline

    # A run

    def begin(self, now: float, timeout: float | None = None) -> None:
        """Begin a run on this thread, which is to end within `timeout` seconds."""
        check_seconds(timeout)
        self._timeout, self._deadline = timeout, math.inf if timeout is None else now + timeout
        self._error = self._drain = None
        self._status, self._burst = Status.INVALID, 0
        self._visitor = ChangeVisitor(self._set_up_missing, self._after_each, self.teller)
        self.teller.begin()
        self.goals.run_goes_on = True
        self.watchdog.begin(self._deadline)

    def step(self, now: float) -> Sleep | Done[Status]:
        """Do what is due now (seconds, steady clock).

        Returns the seconds until the next step, unless a wake-up comes before; at the end the
        tree's status, INVALID when interrupted. The last step raises TimeoutError when out of time,
        a TreeError where a behaviour raised or had no status, or another error that has ended the
        run.
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

        Raises `error` at once where the drain has begun.
        """
        if self._drain is not None:
            self._error = None  # `shutdown` does not raise it again
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
        """Tick if a tick is due; return the seconds until the next look, None at the end."""
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
        """Set up new nodes: the whole tree in the first run, inserted ones later."""
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
                tree.setup(timeout=Duration.INFINITE, node=self._node)  # it may do more
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
        """Return whether the tree is as it was set up; takes about 10 ns a behaviour."""
        found = self._with_children
        return self.tree.root in found and [n.children for n in found] == list(found.values())

    def _tick(self) -> bool:
        """Tick once; return whether a status changed."""
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
        dog, misbehaved = self.watchdog, self._misbehaved
        if dog.seen:
            dog.tick_returned()
        if dog.ends_at < math.inf and dog.gives_up():
            raise _Abandoned
        return "" if misbehaved is None else misbehaved()

    @property
    def _has_others(self) -> bool:
        """Whether a handler or another visitor is called at each tick."""
        tree = self.tree
        return bool(tree.pre_tick_handlers or tree.post_tick_handlers or len(tree.visitors) > 1)

    def _rests_for(self) -> float:
        """Return the seconds until the next tick without an event."""
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
        """Return whether the tree is paused; carry a change of that over to unsent goals."""
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

    # The end of a run

    def _stop(self) -> Drain:
        """Stop running nodes, and begin to drain; tell the reason, where it was not told."""
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
        """Terminate nodes that a terminate() that raised has kept from it."""
        for node in self.tree.root.iterate():
            if node.status is Status.RUNNING:
                try:
                    if node is not culprit:
                        node.terminate(Status.INVALID)
                except BaseException as error:  # noqa: BLE001 - the user's: any
                    self._raised(f"terminate of {node.name} raised", error)
                node.status = Status.INVALID

    def _wind_up(self, drain: Drain) -> Sleep | Done[Status]:
        """Drain the tree's goals, and tell the end."""
        step = drain.step(self._now, hurry=self._abandoned)
        self._tell_observers()
        if isinstance(step, Sleep):
            return step
        self._visitor.stopped()
        self._log.flush()  # the end is told last
        self.teller.finished(self._status, self._error, self.goals.unaccounted)
        self._tell_observers()
        timed_out = self._status is Status.INVALID and not self._stop_wanted
        self._rest()
        self.raise_what_ended_it()
        if timed_out:
            raise TimeoutError(f"{self.tree.root.name} did not finish within {self._timeout:g} s")
        return Done(self._status)

    def raise_what_ended_it(self) -> None:
        """Raise, once, the error that has ended the run, or is to end the program, if any."""
        error, self._error = self._error, None
        try:
            if error is not None:
                raise error
        finally:
            del error

    def close(self) -> None:
        """Tell late news of goals, and tell nothing after that."""
        self.goals.close()
        self._tell_observers()

    def shutdown(self) -> None:
        """Shut down the tree, and pruned nodes, if set up here; else another loop may run it."""
        if not self._nodes:
            return
        nodes = list(self.tree.root.iterate())
        ours = [each for each in nodes if isinstance(each, ActionBehaviour)]
        left = {*self._nodes, *self._pruned}.difference(nodes)
        pruned = [each for each in left if root_of(each) in left]  # and in no other tree
        for shutdown in self.tree.shutdown, *(each.shutdown for each in [*ours, *pruned]):
            try:  # our leaves must let go though another node raises
                shutdown()
            except Exception as error:  # noqa: BLE001 - the user's: any
                self._raised("shutdown of a behaviour raised", error)
        drain(self._traffic.host, self.goals.not_over)

    # Observers

    def _tell_observers(self) -> None:
        """Call each observer with the new events; forget the goals that are over."""
        self.goals.forget()
        steady = self._traffic.host.steady
        for reader, observer in list(self._observers.items()):
            for event in reader.take():
                began = steady()
                try:
                    observer(event)
                except BaseException as error:  # noqa: BLE001 - the run goes on without the observer
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
        """Log an error, and end the run where it is to end the program, as SystemExit is."""
        self._log.error(f"{what}: {raised(error)}")
        if not isinstance(error, Exception):
            self._error = self._error or error
            self._wake()
