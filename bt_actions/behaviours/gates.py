"""`only_if` and `only_while` of any node: conditions under which a node is there at all.

A gate is a part of its node, and no node itself: a RUNNING node with `only_if` alone is ticked as
if it had no gate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.asking import still_ends
from bt_actions.behaviours.leaving import leave_out

Condition = Callable[[], str]
"""Says why a node is left out; "" where it is not. Raises ValueError, which fails the node."""


def gate(behaviour: Behaviour, words: Mapping[str, str], **conditions: Condition) -> None:
    """Have a behaviour be left out where a condition does not hold.

    `only_if` is asked as a visit begins, `only_while` before each tick. A running behaviour is
    stopped, and is RUNNING until the goals below it have ended. `words` are the conditions as text,
    for views.
    """
    _Gate(behaviour, conditions.get("only_if"), conditions.get("only_while"))
    behaviour.gates = dict(words)  # type: ignore[attr-defined]


class _Gate:
    def __init__(
        self, behaviour: Behaviour, only_if: Condition | None, only_while: Condition | None
    ) -> None:
        self._node, self._if, self._while = behaviour, only_if, only_while
        self._tick = tick = behaviour.tick
        self._asks = only_while is not None or getattr(behaviour, "asks", False)
        """Whether a condition is asked at each tick, also while the node is not left out."""
        self._why = ""
        """The reason why the node was stopped, and is to be left out."""
        self._error = ""
        """The reason why the node was stopped, and is to fail."""
        behaviour.left_out, behaviour.asks = False, self._asks  # type: ignore[attr-defined]
        asked, running = self._asked, Status.RUNNING

        def unasked() -> Iterator[Behaviour]:
            """Tick a running behaviour without another level of generators."""
            return tick() if behaviour.status is running else asked()

        behaviour.tick = unasked if only_while is None else asked  # type: ignore[method-assign]

    def _asked(self) -> Iterator[Behaviour]:
        node = self._node
        begins = node.status is not Status.RUNNING
        if begins:
            node.left_out = node.refused = False  # type: ignore[attr-defined]
            node.asks = self._asks  # type: ignore[attr-defined]
            self._why = self._error = ""
        if not (self._why or self._error):
            self._ask(begins)
        if not (self._why or self._error):
            yield from self._tick()
            return
        if node.status is not Status.INVALID:
            node.stop(Status.INVALID)
        if not begins and (waits_for := still_ends(node)):
            node.feedback_message, node.status = (
                f"{self._why or self._error}; {waits_for}",
                Status.RUNNING,
            )
        elif self._error:
            node.feedback_message, node.status = self._error, Status.FAILURE
            node.refused = True  # type: ignore[attr-defined]
        else:
            node.status = leave_out(node, self._why)
            node.asks = True  # type: ignore[attr-defined]
        yield node

    def _ask(self, begins: bool) -> None:
        try:
            if begins and self._if is not None:
                self._why = self._if()
            if not self._why and self._while is not None:
                self._why = self._while()
        except ValueError as error:
            self._error = str(error)
