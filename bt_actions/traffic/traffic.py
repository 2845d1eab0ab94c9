"""The goals of one node, as leaves use them: begin, send and interrupt a goal, and close it all.

A leaf begins a goal here and advances the goal at its ticks. After the send, answers, deadlines and
the watch over the servers (scheduler.py) drive the goal, with ticks of the leaf or without. So a
goal that its leaf leaves behind is drained, too.

One lock guards all of this. No thread waits under the lock, and the only user code under the lock
is `ActionBehaviour.settles`, which says so. Others decide about a goal (goals/goal.py), about its
attempts (goals/attempts.py), and about sending (admission.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, Timeouts
from bt_actions.goals.terms import Event, Now, State
from bt_actions.messages.interfaces import TwoTypes, interface_name
from bt_actions.servers.presence import Server
from bt_actions.traffic import admission, handover, watcher
from bt_actions.traffic.drain import drain
from bt_actions.traffic.driver import apply_deadlines, close_if_unused, report, take_in, tell
from bt_actions.traffic.endpoint import ActionEndpoint
from bt_actions.traffic.state import Action, Endpoint, GoalHandle, Host, Participant, ticking_run
from bt_actions.utilities.plain_text import in_words


class Traffic:
    """All action traffic of one node."""

    def __init__(self, host: Host, participant: Participant) -> None:
        self.host, self.participant = host, participant
        self.closed = False
        """Whether the node was destroyed; the next tree needs another node."""
        self._domain = host.domain(participant.domain)
        self._endpoints: dict[str, Endpoint] = {}

    def endpoint(self, action_type: Any, action_name: str) -> Endpoint:
        """Return the shared endpoint to an action, and count its user.

        A remapping rule for the action's name has no effect, and a warning says so. Raises
        ValueError for a name that ROS refuses, and TwoTypes where the name is in use with another
        type.
        """
        name = self.participant.full_name(action_name)
        with self.host.lock:
            endpoint = self._endpoints.get(name)
            if endpoint is None:
                endpoint = self._open_to((action_type, name))
            elif endpoint.action[0] is not action_type:
                raise TwoTypes(name, action_type, [interface_name(endpoint.action[0])])
            endpoint.users += 1
            watcher.look_early(endpoint, self.host.steady())
            return endpoint

    def _open_to(self, action: Action) -> Endpoint:
        """Return a new endpoint to an action, with no user yet."""
        endpoint = self._endpoints[action[1]] = ActionEndpoint(
            self.host, self.participant, self._endpoints, action
        )
        handover.adopt(endpoint)
        return endpoint

    def leave(self, endpoint: Endpoint) -> None:
        """Count off a user of `endpoint`; without users and open goals the endpoint is closed."""
        with self.host.lock:
            endpoint.users -= 1
            if endpoint.users <= 0:
                handover.park(endpoint)
            close_if_unused(endpoint)

    # A leaf's calls

    def begin(
        self,
        endpoint: Endpoint,
        owner: Any,
        timeouts: Timeouts,
        resources: frozenset[str],
        busy: Busy,
        *,
        attempt: int = 1,
        keeps_feedback: bool = False,
        accounts_for_all: Callable[[Any], bool] = lambda result: True,
    ) -> GoalHandle:
        """Begin a goal, which queues for its resources; `advance` sends it.

        A resource is named as an action is: a relative name is in the node's namespace.
        `accounts_for_all` gets the result, under the lock; where it returns False, the goal's end
        is UNKNOWN.
        """
        with self.host.lock:
            now = self.participant.now()
            goal = Goal(
                self.host.new_goal_id(), endpoint.name, timeouts, now,
                resources=frozenset(self._full_name(each) for each in resources),
                busy=busy, accounts_for_all=accounts_for_all,
            )  # fmt: skip
            handle = GoalHandle(
                goal, endpoint, owner, owner.name, ticking_run.get(), attempt, keeps_feedback, now
            )
            take_in(endpoint, handle)
            answer = self._domain.resources.request(handle, goal.resources, busy)
            if answer is None:
                report(handle)
            else:
                tell(handle, answer)
            return handle

    def _full_name(self, name: str) -> str:
        """Expand the name of a resource, which may be what ROS would refuse as a name."""
        name, namespace = name.rstrip("/"), self.participant.namespace.rstrip("/")
        if name.startswith("/"):
            return name
        if name.startswith("~"):
            return f"{namespace}/{self.participant.name}{name[1:]}"
        return f"{namespace}/{name}"

    def advance(
        self,
        handle: GoalHandle,
        make_message: Callable[[], Any],
        is_plain: Callable[[], bool] = lambda: False,
    ) -> None:
        """Take a goal as far as it goes now: send it, where its server is ready. Never waits.

        From now on the goal belongs to the run that ticks its leaf. `make_message` is called on the
        caller's thread, at most once a call; an error in it makes the goal INVALID_GOAL. The call
        is made without the lock (the server may go meanwhile), unless `is_plain` says that
        `make_message` runs no code of the user's.
        """
        endpoint, handle.run = handle.endpoint, ticking_run.get() or handle.run
        if handle.goal.state is State.DONE:
            return
        at_once = handle.goal.state is State.WAITING_FOR_SERVER and is_plain()
        with self.host.lock if at_once else nullcontext():
            if not self._is_due(handle):
                return
            try:
                message = make_message()
            except Exception as error:  # noqa: BLE001 - the user's: any
                # in_words may run code of the user's: before `tell` takes the lock
                tell(handle, Event.INVALID, in_words(error))
                return
            with self.host.lock:
                if at_once or (endpoint.participant.alive() and self._may_send(handle)):
                    handle.goal.message = message
                    tell(handle, Event.SERVER_READY)

    def _is_due(self, handle: GoalHandle) -> bool:
        """Apply due deadlines, look at the server, and return whether to send the goal now."""
        endpoint = handle.endpoint
        with self.host.lock:
            apply_deadlines(handle)
            if self.host.closing:
                tell(handle, Event.INTERRUPTED)
            if handle.goal.state is not State.WAITING_FOR_SERVER:
                return False
            if watcher.recent_state(endpoint, self.host.steady()) is Server.AMBIGUOUS:
                tell(handle, Event.SERVER_AMBIGUOUS)
            return self._may_send(handle)

    def _may_send(self, handle: GoalHandle) -> bool:
        """Return whether to send the goal now; lost goals that stand in its way come first."""
        now = self.host.steady()
        if self.host.closing or not admission.finds_server(handle, now):
            return False
        if handle.endpoint.domain.left or self._domain.lost:
            self._cancel_what_is_back(handle, now)
        return admission.is_clear(handle, now)

    def _cancel_what_is_back(self, handle: GoalHandle, now: float) -> None:
        """Look at each server with lost goals that this goal might run beside; cancel what is back.

        Opens an endpoint where this node has none.
        """
        left = admission.left_near(handle)
        to_see = dict.fromkeys(each.endpoint for each in left if each.goal.lost)
        actions = {each.action: None for each in to_see}
        for action, lost in list(self._domain.lost.items()):
            if any(each.goal.resources & handle.goal.exclusive for each in lost):
                actions[action] = None
                if action[1] not in self._endpoints:  # no leaf uses that server any more
                    self._open_to(action)
        for action in actions:
            ours = self._endpoints.get(action[1])
            if ours is not None and ours.action == action:
                to_see[ours] = None
        for endpoint in to_see:  # all first: one may see the server that another has lost
            watcher.look(endpoint, now)

    def deadline(self, handle: GoalHandle, now: Now) -> tuple[Event, float] | None:
        """Return the goal's next deadline, and the seconds until then; arrivals change both."""
        with self.host.lock:
            return handle.goal.deadline(now)

    def result_due_in(self, handle: GoalHandle) -> float | None:
        """Return the seconds until the result of a goal that executes is due; None: no deadline."""
        with self.host.lock:
            left = handle.goal.deadlines.left(self.participant.now())
        return next((max(s, 1e-3) for s, event in left if event is Event.RESULT_DUE), None)

    def interrupt(self, handle: GoalHandle) -> None:
        """Tell the goal that the tree no longer wants it, and return at once; a drain follows."""
        tell(handle, Event.INTERRUPTED)

    def pause(self, handles: Iterable[GoalHandle], wanted: bool) -> None:
        """Stop the deadlines of goals that were not sent yet, or let them run on."""
        with self.host.lock:
            for handle in handles:
                handle.paused = wanted and not handle.goal.sent
                apply_deadlines(handle)

    def destroy(self, hurry: Callable[[], bool] = lambda: False) -> None:
        """Drain all open goals and close the transports; nobody may spin the node any more."""
        with self.host.lock:
            left = [each for endpoint in self._endpoints.values() for each in endpoint.handles]
        drain(self.host, left, hurry)
        with self.host.lock:
            self.closed = True
            for endpoint in list(self._endpoints.values()):
                handover.park(endpoint, all_of_them=True)
                for handle in endpoint.handles:
                    tell(handle, Event.ABANDONED)
                endpoint.transport.close()
            self._endpoints.clear()
