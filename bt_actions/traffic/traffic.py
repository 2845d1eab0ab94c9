"""Carries out what goals and resources decide, for every goal of this process, until it is done.

A leaf begins a goal here and advances it at its ticks. From the moment the request is out, the
goal is driven by what arrives, whether or not anybody ticks: answers (on executor threads),
deadlines and the watch over the servers (on the alarm, a plain thread that sleeps while no goal is
open). What a leaf leaves behind is thereby drained without it.

One lock guards all of it. Under the lock nothing waits, and no code of the user's runs: observers
only take note. This file decides nothing about a goal (goals/goal.py), its tries
(goals/attempts.py), or whether a server is alive (servers/presence.py).
"""

from __future__ import annotations

import atexit
import contextlib
import os
import time
import weakref
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node

from bt_actions.goals.goal import Goal
from bt_actions.goals.ids import new_goal_id
from bt_actions.goals.policy import Busy, End, Timeouts
from bt_actions.goals.resources import Answer
from bt_actions.goals.terms import Event, Now, State
from bt_actions.ros.alive import is_valid
from bt_actions.ros.clocks import Clocks
from bt_actions.ros.log import log
from bt_actions.ros.signals import ended_by_signals
from bt_actions.servers.presence import Server
from bt_actions.traffic import alarm, shared
from bt_actions.traffic.begun import begun_in
from bt_actions.traffic.drain import drain
from bt_actions.traffic.endpoint import ActionEndpoint
from bt_actions.traffic.shared import (
    Change,
    GoalHandle,
    Observer,
    changed,
    domain_of,
    ledger,
    lock,
)
from bt_actions.utilities.plain_text import in_words, raised

IN_FLIGHT = 8
"""Goal requests of this process under way at a server; its queue holds 10, and drops what is over
silently."""
_ON_NODE = "_bt_actions_traffic"
_contexts: weakref.WeakKeyDictionary[Any, _Participant] = weakref.WeakKeyDictionary()
_closing = False  # the process ends: a tree that ticks on begins nothing any more


class _Participant:
    """That of a context, as long as any of its nodes is there: the next one gets a new one.

    Or the same, where the user has another node there, of which nobody tells us.
    """

    def __init__(self, before: _Participant | None) -> None:
        self.since = time.monotonic()
        """Since when it is known here; a new one is blind to nothing."""
        now = alarm.stalls.long_times
        self.long_stalls: int = now if before is None else before.long_stalls
        """How often this process had stood still for long by then: it may be deaf where an endpoint
        is made after more of them."""
        self.nodes: weakref.WeakSet[Node] = weakref.WeakSet()


class Traffic:
    """All action traffic of one node."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.clocks = Clocks(node)
        self.domain = domain_of(node.context.get_domain_id())
        seen = _contexts.get(node.context)
        if seen is None or not any(is_valid(each) for each in seen.nodes):
            alarm.appears()
            seen = _contexts[node.context] = _Participant(seen)
        seen.nodes.add(node)
        self.seen_since, self.long_stalls = seen.since, seen.long_stalls
        self.made_at = time.monotonic()
        self._namespace = node.get_namespace().rstrip("/")
        self._name = node.get_name()
        self._endpoints: dict[str, ActionEndpoint] = {}
        self._warned_of: set[str] = set()
        self._observers: list[Observer] = []

    @classmethod
    def of(cls, node: Node) -> Traffic:
        """Return the one Traffic of `node`."""
        with lock:
            traffic: Traffic | None = getattr(node, _ON_NODE, None)
            if traffic is None:
                traffic = cls(node)
                setattr(node, _ON_NODE, traffic)  # lives as long as the node does
            return traffic

    def endpoint(self, action_type: Any, action_name: str) -> ActionEndpoint:
        """Return the shared endpoint to an action, and count its user.

        A remapping rule for the action's name has no effect, and is warned of. Raises ValueError
        for a name that ROS refuses, and TypeError when it is in use with another type.
        """
        name = expand_topic_name(action_name, self.node.get_name(), self.node.get_namespace())
        with lock:
            endpoint = self._endpoints.get(name)
            if endpoint is None:
                self._warn_of_remapping(name)
                endpoint = self._endpoints[name] = ActionEndpoint(self, action_type, name)
            elif endpoint.action_type is not action_type:
                raise TypeError(
                    f"{name} is used with two types: {endpoint.action_type.__module__}."
                    f"{endpoint.action_type.__name__} and {action_type.__module__}."
                    f"{action_type.__name__}"
                )
            endpoint.users += 1
            return endpoint

    def _warn_of_remapping(self, name: str) -> None:
        """Say it, once for a name, where a rule would have it another: ROS remaps no action."""
        other, part = self.node.resolve_service_name(name), f"{name}/_action/send_goal"
        remapped = self.node.resolve_service_name(part) != part
        if other != name and not remapped and name not in self._warned_of:
            self._warned_of.add(name)
            log.warning(
                f"a rule remaps {name} to {other}, and has no effect: ROS does not remap actions. "
                f"Name {other} where the action is used, set the namespace of the node, or remap "
                f"its parts: {part}, cancel_goal, get_result, feedback and status"
            )

    def leave(self, endpoint: ActionEndpoint) -> None:
        """Count a user of `line` off; with the last one, and no goal open, its client goes too."""
        with lock:
            endpoint.users -= 1
            if endpoint.users <= 0:
                endpoint.park()
            self.drop_if_unused(endpoint)

    def drop_if_unused(self, endpoint: ActionEndpoint) -> None:
        """Destroy the client of an endpoint that has no user and no open goal.

        Not before it has delivered all: a second server may have taken the last goal, too.
        """
        unused = endpoint.users <= 0 and not endpoint.goals and not endpoint.client.has_more
        if unused and self._endpoints.get(endpoint.name) is endpoint:
            del self._endpoints[endpoint.name]
            endpoint.close()

    # A leaf's calls

    def begin(
        self,
        endpoint: ActionEndpoint,
        owner: Any,
        timeouts: Timeouts,
        resources: frozenset[str],
        busy: Busy,
        *,
        attempt: int = 1,
        keeps_feedback: bool = False,
        settles: Callable[[Any], bool] = lambda result: True,
    ) -> GoalHandle:
        """Begin a goal: it queues for its resources. It is sent by `advance`.

        A resource is named as an action is: what is relative is in the node's namespace. `settles`
        is asked with the result, under the lock: where it says no, the goal's end is UNKNOWN.
        """
        with lock:
            now = self.clocks.now()
            held = frozenset(self._full_name(each) for each in resources)
            goal = Goal(
                new_goal_id(), endpoint.name, timeouts, now,
                resources=held, busy=busy, settles=settles,
            )  # fmt: skip
            began = begun_in.get()
            handle = GoalHandle(
                goal, endpoint, self, owner, owner.name, began, attempt, keeps_feedback
            )
            handle.begun_at = time.monotonic()
            endpoint.goals[goal.id] = handle
            alarm.mind(endpoint)
            answer = self.domain.resources.request(handle, goal.resources, busy)
            if answer is Answer.GRANTED:
                endpoint.tell(handle, Event.GRANTED)
            elif answer is Answer.TAKEN:
                endpoint.tell(handle, Event.TAKEN)
            else:
                self.note(handle)
            return handle

    def _full_name(self, name: str) -> str:
        """Expand the name of a resource, which may be what ROS would refuse as a name."""
        name = name.rstrip("/")
        if name.startswith("/"):
            return name
        if name.startswith("~"):
            return f"{self._namespace}/{self._name}{name[1:]}"
        return f"{self._namespace}/{name}"

    def advance(self, handle: GoalHandle, make_message: Callable[[], Any]) -> None:
        """Take a goal as far as it goes now: send it, where its server is ready. Never waits.

        `make_message` is called without the lock, on the caller's thread, at most once a call (the
        server may go meanwhile); what it raises makes the goal INVALID_GOAL.
        """
        endpoint = handle.endpoint
        with lock:
            if handle.goal.state is State.DONE:
                return
            endpoint.poll(handle)
            if _closing:
                endpoint.tell(handle, Event.INTERRUPTED)
            if handle.goal.state is not State.WAITING_FOR_SERVER:
                return
            if endpoint.look(time.monotonic()) is Server.AMBIGUOUS:
                endpoint.tell(handle, Event.SERVER_AMBIGUOUS)
            if not self._may_send(handle):
                return
        try:
            message = make_message()
        except Exception as error:  # noqa: BLE001 - the user's: any
            endpoint.tell(
                handle, Event.INVALID, in_words(error)
            )  # which may run code of the user's
            return
        with lock:
            if self._may_send(handle):
                endpoint.tell(handle, Event.SERVER_READY, message=message)

    @staticmethod
    def is_settled(handle: GoalHandle) -> bool:
        """Whether its outcome is decided, and what is known of its end then is, too."""
        with lock:  # a goal takes one step at a time
            return handle.goal.outcome is not None

    @staticmethod
    def deadline(handle: GoalHandle, now: Now) -> tuple[Event, float] | None:
        """Its next deadline, and the seconds until then; these change with what arrives."""
        with lock:
            return handle.goal.deadline(now)

    def _may_send(self, handle: GoalHandle) -> bool:
        endpoint = handle.endpoint
        return (
            handle.goal.state is State.WAITING_FOR_SERVER
            and not _closing
            and not endpoint.route.holds_back(time.monotonic())
            and not endpoint.orphaned
            and is_valid(self.node)
            and endpoint.watch.state(time.monotonic()) is Server.READY
            and not endpoint.may_overtake(handle)
            and not self._conflicts(handle)
            and endpoint.in_flight() < IN_FLIGHT
        )

    def _conflicts(self, handle: GoalHandle) -> bool:
        """Whether a goal that any node of this process gave up must be canceled first.

        One that was lost holds nothing any more; should its server be back, it is canceled first.
        """
        endpoints = handle.endpoint.neighbors()
        left = {
            (endpoint.name, endpoint.action_type)
            for endpoint in endpoints
            if endpoint.has_lost(handle)
        }
        if handle.goal.busy in (Busy.WAIT, Busy.FAIL):
            remembered = self.domain.lost_with(handle.goal.resources)
            left.update(remembered)
            for action, action_type in remembered:
                if (
                    action not in self._endpoints
                ):  # another's server, which nobody speaks to any more
                    self._endpoints[action] = ActionEndpoint(self, action_type, action)
        now = time.monotonic()
        ours = [
            endpoint
            for endpoint in self._endpoints.values()
            if (endpoint.name, endpoint.action_type) in left
        ]
        for endpoint in {*endpoints, *ours}:  # all of them first: one may see what another has lost
            if endpoint.has_lost(handle) or endpoint in ours:
                endpoint.look(now)
        return any(
            endpoint.conflicts_with(handle) or endpoint.may_come_back_for(handle, now)
            for endpoint in handle.endpoint.neighbors()
        )

    def interrupt(self, handle: GoalHandle) -> None:
        """The tree no longer wants it. Returns at once; the goal is drained."""
        handle.endpoint.tell(handle, Event.INTERRUPTED)

    def pause(self, handles: Iterable[GoalHandle]) -> None:
        """Stop the deadlines of goals that were not sent yet."""
        with lock:
            for handle in handles:
                if not handle.goal.sent and handle.paused_at is None:
                    handle.paused_at = time.monotonic()

    def resume(self, handles: Iterable[GoalHandle]) -> None:
        """Let the deadlines run on, with what remained of them."""
        with lock:
            for handle in handles:
                if handle.paused_at is not None:
                    handle.goal.postpone(time.monotonic() - handle.paused_at)
                    handle.paused_at = None

    # Who watches

    def observe(self, observer: Observer) -> None:
        """Call `observer` at every change, under the lock: it must only take note."""
        with lock:
            self._observers.append(observer)

    def unobserve(self, observer: Observer) -> None:
        """Stop calling `observer`."""
        with lock, contextlib.suppress(ValueError):
            self._observers.remove(observer)

    def note(self, handle: GoalHandle) -> None:
        """Report a goal's change to the log and the observers."""
        goal = handle.goal
        unknown = goal.outcome is not None and goal.end is End.UNKNOWN
        if unknown and not handle.told_unknown:
            if handle.told_gone:
                log.warning(
                    f"{goal!r}: its server is back; canceling it, should it still run there"
                )
            else:
                why = f"{goal.reason}{goal.cancel_said}"
                log.error(f"{goal!r}: not accounted for, it may still be running: {why}")
        elif not unknown and handle.told_unknown:
            log.info(f"{goal!r}: accounted for at last")
        handle.told_unknown, handle.told_gone = unknown, goal.end is End.SERVER_GONE
        now = self.clocks.now().ros
        self.notify(Change(now, handle, goal.state, goal.outcome, goal.end, goal.reason))

    def notify(self, change: Change | None) -> None:
        """Tell the observers, and whoever waits."""
        for observer in list(self._observers):
            try:
                observer(change)
            except Exception as error:  # noqa: BLE001 - the run goes on without it
                self._observers.remove(observer)
                log.error(f"an observer of goals raised and was removed: {raised(error)}")
        changed.notify_all()

    def destroy(self) -> None:
        """Drain what is still open and destroy the clients; nobody may spin the node any more."""
        with lock:
            left = [
                handle
                for endpoint in self._endpoints.values()
                for handle in endpoint.goals.values()
            ]
        drain(left)
        with lock:
            endpoints, self._endpoints = list(self._endpoints.values()), {}
            for endpoint in endpoints:
                endpoint.park(all_of_them=True)
                for handle in list(endpoint.goals.values()):
                    endpoint.tell(handle, Event.PROCESS_EXITING)
                endpoint.close()
                alarm.forget(endpoint)
            setattr(self.node, _ON_NODE, None)
            ledger.close()


@atexit.register
def close_process() -> None:
    """Close what a loop that crashed, or never called shutdown, has left; send nothing more.

    For a process that ends: this cannot be undone. A first signal meanwhile waits, and a second one
    ends the wait.
    """
    global _closing
    hurried = False

    def hurry(again: bool, _ends_process: bool) -> None:
        nonlocal hurried
        hurried = hurried or again

    with contextlib.suppress(KeyboardInterrupt), ended_by_signals(hurry):
        with lock:
            _closing = True
            endpoints = [
                endpoint for endpoint in alarm.minded() if isinstance(endpoint, ActionEndpoint)
            ]
            handles = [handle for endpoint in endpoints for handle in endpoint.goals.values()]
        left = [handle for handle in handles if not handle.goal.lost or handle.looked_out_for]
        try:
            drain(left, lambda: hurried)
        finally:
            for handle in left:
                if not handle.is_over:
                    log.error(f"{handle.goal!r}: the process ends and cannot account for it")
            with lock:
                ledger.close()
            log.flush()


def _disown() -> None:
    """In the child of a fork: the goals are the parent's, and so is what guards them."""
    atexit.unregister(close_process)
    alarm.disown()
    shared.disown()


os.register_at_fork(after_in_child=_disown)
