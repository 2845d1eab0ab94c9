"""Finds and cancels goals that a killed orchestrator left on servers it can no longer speak to.

A process that dies by SIGKILL cancels nothing. Its goals are found in the status topics of all
actions in sight, told by their ids (goal_ids.py), and canceled one by one; goals of other clients,
and of orchestrators that are alive, or that cannot be looked for from here, are never touched. No
action type is needed for any of it.
"""

from __future__ import annotations

import contextlib
import time
import uuid
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.context import Context
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default
from unique_identifier_msgs.msg import UUID

from bt_actions.goal_ids import Author, author_of
from bt_actions.goal_terms import ENDS
from bt_actions.policy import End
from bt_actions.ros.graph import servers
from bt_actions.standstill import AT_MOST, Standstill

STATUS = "/_action/status"
ASK_AGAIN = 1.0
"""Seconds between two requests to cancel the same goal."""
SETTLE = 4.0
"""Seconds after an action came in sight within which its status must have been received; where a
client was just killed, that took 2.2 s each time, else 0.02 s (Fast DDS offers again every 3 s)."""

LOOK_LONGEST = 30.0
"""Seconds for which a server of a wanted action may take to answer: a ghost is shown for 20."""


@dataclass(slots=True)
class LeftBehind:
    """A goal whose orchestrator is dead. `end` is UNKNOWN until the server tells.

    Where `servers` of one name are shown, and not one, it stays UNKNOWN: either may run it, and a
    status does not tell whose it is.
    """

    action: str
    goal_id: bytes
    pid: int
    shown: End = End.UNKNOWN
    servers: int = 1
    asked_at: float = float("-inf")

    @property
    def end(self) -> End:
        """How it ended, as far as is known."""
        return self.shown if self.servers <= 1 else End.UNKNOWN


class CannotStart(RuntimeError):
    """ROS 2 cannot start: the domain id is none, say."""


def cleanup(
    *,
    look: float = 5.0,
    patience: float = 5.0,
    found: Callable[[LeftBehind], None] = lambda left: None,
    sighted: Callable[[str], None] = lambda action: None,
    elsewhere: Callable[[str, bytes], None] = lambda action, goal_id: None,
    wanted: Collection[str] | None = None,
    namespace: str = "",
    missing: Callable[[list[str], bool], None] = lambda actions, in_vain: None,
    context: Context | None = None,
) -> list[LeftBehind]:
    """Cancel what dead orchestrators of this machine left; return it with its ends.

    Looks for servers for `look` seconds (longer while new ones come in sight), and waits `patience`
    seconds more for the goals that it canceled to end. `found` is called with each at once,
    `sighted` with the name of each action of which a server is in sight, and `elsewhere` with the
    action and the id of each unfinished goal of a bt_actions process on another machine, or in
    another container, of which nobody here can tell whether it is alive. Of the actions in
    `wanted`, whose relative names belong to `namespace` (None: of all in sight), those of which no
    server has answered by then (one that is shown may be stopped, or a ghost) are waited for up to
    LOOK_LONGEST seconds, and `missing` is called with them, in the beginning of that, and in the
    end if it was in vain, as it is told. Blocks.

    Where a server in sight does not answer, or this process stands still for long meanwhile, it may
    be that it will never tell this participant anything (ros/lookout.py). So it looks again with a
    new one, unless `context` is given.

    Raises CannotStart, if nothing has been looked at yet.
    """
    sweep = _Sweep(found, sighted, elsewhere, missing)
    for tries_left in (2, 1, 0) if context is None else (0,):
        still = Standstill()
        still.lives(time.monotonic())  # it counts from when the participant is made
        try:
            with _participant(context, namespace) as (node, executor):
                sweep.begin(node, wanted)
                if sweep.goes_through(executor, still, look, patience, breaks_off=tries_left > 0):
                    break
        except CannotStart:
            if not sweep.has_begun:
                raise
            sweep.gives_up()
            break
    return list(sweep.left.values())


@contextlib.contextmanager
def _participant(
    context: Context | None, namespace: str
) -> Iterator[tuple[Node, SingleThreadedExecutor]]:
    own = Context() if context is None else context
    try:
        if context is None:
            own.init()
        node = Node("bt_actions_cleanup", context=own, namespace=namespace)
    except (RuntimeError, NameValidationException) as error:  # of the first, rclpy's RCLError
        if context is None:
            own.try_shutdown()
        raise CannotStart(str(error).splitlines()[0]) from error
    executor = SingleThreadedExecutor(context=own)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        if context is None:
            own.shutdown()


class _Sweep:
    """What was found, in one participant after another."""

    def __init__(
        self,
        found: Callable[[LeftBehind], None],
        sighted: Callable[[str], None],
        elsewhere: Callable[[str, bytes], None],
        missing: Callable[[list[str], bool], None],
    ) -> None:
        self._found = found
        self._sighted = sighted
        self._elsewhere = elsewhere
        self._missing = missing
        self._foreign: set[bytes] = set()
        self._began = time.monotonic()
        self.has_begun = False
        self._waits = False
        self._answered: set[str] = set()
        self._shown: set[str] = set()  # actions of which a server was shown, to any node
        self._minded: dict[bytes, tuple[str, Author]] = {}  # goals of who is alive, or was
        self.left: dict[bytes, LeftBehind] = {}

    def begin(self, node: Node, wanted: Collection[str] | None) -> None:
        """Go on with what this node sees; servers of `wanted` actions have to answer it.

        Or those of all in sight: one that was stopped may never hear of us.
        """
        self.has_begun = True
        self._all = wanted is None
        self._node = node
        self._subscriptions: dict[str, Any] = {}
        self._clients: dict[str, Any] = {}
        self._asked_at = float("-inf")
        here = node.get_name(), node.get_namespace()  # remapped, as that of the run will be
        wants = {expand_topic_name(name, *here) for name in wanted or ()}
        self._unanswered = wants - self._answered
        self._newest = float("-inf")  # when the last action came in sight, or a server answered

    def goes_through(
        self,
        executor: SingleThreadedExecutor,
        still: Standstill,
        look: float,
        patience: float,
        *,
        breaks_off: bool,
    ) -> bool:
        """Look, cancel, and wait; return False where it `breaks_off`, for another participant.

        Because of a standstill, or of a server in sight that does not answer.
        """
        looked = time.monotonic() + look
        while True:
            now = time.monotonic()
            looked = max(looked, self._newest + SETTLE)
            held = max(still.answers_take(now), still.servers_take(now))
            if still.long_times and breaks_off:
                self._answered.clear()  # their status may be lost
                return False
            if held > 0.0 and still.times <= AT_MOST:  # what there is may not be in sight again
                looked = max(looked, now + held)
            lacks = sorted(self._unanswered)
            if lacks and now >= looked:
                if not self._waits:
                    self._waits = True
                    self._missing(lacks, False)
                if breaks_off and not self._shown.isdisjoint(lacks):
                    return False  # it may not hear this participant
                if now < self._began + LOOK_LONGEST:
                    looked = now + 1.0
            if now < looked:
                self._discover(now)
            elif self._over or now >= looked + patience:
                break
            self._ask()
            executor.spin_once(timeout_sec=0.05)
        if lacks:
            self._missing(lacks, True)
        return True

    def gives_up(self) -> None:
        """There is no other participant: what has not answered never will."""
        if lacks := sorted(self._unanswered | (self._shown - self._answered)):
            self._missing(lacks, True)

    @property
    def _over(self) -> bool:
        """Whether every goal that was found has ended."""
        return all(goal.end is not End.UNKNOWN for goal in self.left.values())

    def _discover(self, now: float) -> None:
        """Listen to every action's status that is in sight."""
        for topic, _types in self._node.get_topic_names_and_types():
            if topic.endswith(STATUS) and topic not in self._subscriptions:
                action = topic.removesuffix(STATUS)
                self._newest = now
                self._subscriptions[topic] = self._node.create_subscription(
                    GoalStatusArray,
                    topic,
                    lambda message, action=action: self._read(action, message),
                    qos_profile_action_status_default,
                )
        for topic in self._subscriptions:
            action = topic.removesuffix(STATUS)
            if action not in self._shown and self._node.count_publishers(topic):  # no mere client
                self._shown.add(action)
                self._newest = now
                self._sighted(action)

    def _read(self, action: str, message: Any) -> None:
        self._hears(action)
        for entry in message.status_list:
            goal_id = bytes(entry.goal_info.goal_id.uuid)
            left = self.left.get(goal_id)
            if left is not None:
                left.shown = ENDS.get(entry.status, End.UNKNOWN)
                continue
            author = author_of(goal_id)
            if entry.status in ENDS or author is None:
                self._minded.pop(goal_id, None)
            elif author.alive and not author.here:
                if goal_id not in self._foreign:
                    self._foreign.add(goal_id)
                    self._elsewhere(action, goal_id)
            else:
                self._minded[goal_id] = action, author
        self._find()

    def _find(self) -> None:
        """See who of those that left goals is dead by now: a status comes at a change only."""
        for goal_id, (action, author) in list(self._minded.items()):
            if not author.alive:
                del self._minded[goal_id]
                left = self.left[goal_id] = LeftBehind(action, goal_id, author.pid)
                self._found(left)

    def _ask(self) -> None:
        """Ask the servers to cancel what has not ended, again every second."""
        now = time.monotonic()
        self._find()
        for left in self.left.values():
            left.servers = len(servers(self._node, left.action))
            if left.end is not End.UNKNOWN or now - left.asked_at < ASK_AGAIN:
                continue
            if self._cancel(left.action, left.goal_id):
                left.asked_at = now
        if now - self._asked_at >= ASK_AGAIN:
            self._asked_at = now
            if self._all:
                self._unanswered |= self._shown - self._answered
            for action in sorted(self._unanswered):
                self._cancel(action, uuid.uuid4().bytes)  # nobody's: any answer shows that it lives

    def _cancel(self, action: str, goal_id: bytes) -> bool:
        client = self._clients.get(action)
        if client is None:
            client = self._clients[action] = self._node.create_client(
                CancelGoal, f"{action}/_action/cancel_goal"
            )
        if not client.service_is_ready():
            return False
        request = CancelGoal.Request()
        request.goal_info.goal_id = UUID(uuid=list(goal_id))
        client.call_async(request).add_done_callback(lambda _: self._hears(action))
        return True

    def _hears(self, action: str) -> None:
        if action not in self._answered:
            self._answered.add(action)
            self._unanswered.discard(action)
            self._newest = time.monotonic()  # its status may be under way
