"""One node that failed, or was stopped, with what led to it. Folded from events; see state.py."""

from __future__ import annotations

from dataclasses import dataclass

from bt_actions.events.kinds import Moment, Node, RoundBegan
from bt_actions.story.actions import ActionStory, GoalStory


@dataclass(slots=True)
class Failure:
    """One node that failed of itself."""

    node: Node
    at: Moment
    holders: tuple[Node, ...]
    """The nodes above it, upwards, as they stood then: each may be taken out later."""
    message: str
    items: tuple[tuple[Node, RoundBegan], ...] = ()
    """The rounds of the loops that it failed in, the outermost first."""
    action: ActionStory | None = None
    """What the action did; None for a node that is no action."""
    attempts: tuple[GoalStory, ...] = ()
    """Of an action: the goals of the visit that failed."""
    below: tuple[Failure, ...] = ()
    """What the node has stopped, where its time was over, or its guard did not hold."""
    by: Node | None = None
    """The node that went on in spite of it; None while it is passed on upwards."""
    ran: float | None = None
    """Of a node that was stopped as the run was to end, and has not failed: the seconds that it
    had run."""
    in_tick: bool = False
    """Whether it spent these in one tick, which held up the run."""

    @property
    def path(self) -> tuple[str, ...]:
        """The names from the root down to the node."""
        return (*(above.name for above in reversed(self.holders)), self.node.name)

    @property
    def place(self) -> str:
        """file:line:column, or ""."""
        return self.node.place


@dataclass(frozen=True, slots=True)
class Warned:
    """A leaf that succeeded in something that may not be what was meant."""

    node: Node
    path: tuple[str, ...]
    message: str
