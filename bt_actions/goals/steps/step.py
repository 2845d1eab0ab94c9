"""What a step of the table is: it changes the facts of a goal, and says where the goal is then.

A step sends nothing: what its caller has to do is left in the goal's `commands`. The first line of
its docstring is data: docs/goal.md shows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bt_actions.goals.facts import Facts
from bt_actions.goals.terms import State

Does = Callable[[Facts, Any], State]
"""Takes the goal and what came with the event; returns the next state."""


@dataclass(frozen=True, slots=True)
class Step:
    """One decision: what is done, in words too, and which states may follow."""

    does: Does
    to: frozenset[State]
    """Beside the state in which it is made."""
    says: str

    def __call__(self, goal: Facts, detail: Any = None) -> State:
        """Make it."""
        return self.does(goal, detail)


def leads_to(*to: State) -> Callable[[Does], Step]:
    """Make a function a step, which leads to one of these states or stays where it is.

    What docs/goal.md says of it is the first line of the function's docstring.
    """
    return lambda does: Step(does, frozenset(to), (does.__doc__ or "").splitlines()[0].rstrip("."))


@leads_to()
def drop(goal: Facts, detail: Any) -> State:
    """Nothing: it came too late, or twice, to mean anything."""
    return goal.state
