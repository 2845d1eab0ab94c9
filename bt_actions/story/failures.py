"""One node that failed, or was stopped, with its causes. Folded from events; see state.py."""

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
    """The story of the action; None for a node that is no action."""
    attempts: tuple[GoalStory, ...] = ()
    """The goals of an action's visit that failed."""
    below: tuple[Failure, ...] = ()
    """The nodes that it has stopped, as its time was over, or its guard did not hold."""
    by: Node | None = None
    """The node that went on in spite of it; None while it is passed on upwards."""
    ran: float | None = None
    """The seconds that a node had run when the end of the run stopped it; None after a failure."""
    in_tick: bool = False
    """Whether the node spent these in one tick, which held up the run."""

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
    """A leaf that succeeded in something that may not be meant."""

    node: Node
    path: tuple[str, ...]
    message: str
