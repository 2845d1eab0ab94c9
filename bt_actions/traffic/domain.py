"""What all nodes of a process in one ROS domain share: resources, open endpoints, lost goals."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator

from bt_actions.goals.resources import Resources
from bt_actions.traffic.cancel_queue import Cancels
from bt_actions.traffic.handle import Action, Endpoint, GoalHandle


class Effects:
    """What goals have decided is to be done, in that order; the caller holds the host's lock."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._runs = False

    def run(self, effects: Iterable[Callable[[], None]]) -> None:
        """Do these behind what was decided before, and what is decided meanwhile behind these.

        Where that is under way, whoever has begun it does all.
        """
        self._waiting.extend(effects)
        if self._runs:
            return
        self._runs = True
        try:
            while self._waiting:
                self._waiting.popleft()()
        finally:
            self._runs = False


class Domain:
    """What all nodes of this process in one ROS domain share."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.resources: Resources[GoalHandle] = Resources()
        self.effects = Effects()
        self.open: dict[Endpoint, None] = {}
        """The endpoints with goals, of all nodes, in the order in which they came."""
        self.unsent: dict[GoalHandle, None] = {}
        """Goals that are to be sent, and some that were since (Driver drops them)."""
        self.ever_lost_sight = False
        """A server went out of sight once: what else its process serves may have, too."""
        self.known: set[Action] = set()
        """The actions that had a server once."""
        self.lost: dict[Action, list[GoalHandle]] = defaultdict(list)
        """Lost goals whose endpoint is gone: their server may be back for the next one."""
        self.cancels: dict[Action, Cancels] = defaultdict(Cancels)
        """The cancel requests of this process."""

    def handles(self) -> Iterator[GoalHandle]:
        """Yield the goals of all open endpoints."""
        for endpoint in self.open:
            yield from endpoint.goals.values()
