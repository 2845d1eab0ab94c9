"""A tree inside a tree: its values are its own.

When it starts it writes the inputs, when it ends it gives back the outputs. It never looks into
the tree it holds.
"""

from __future__ import annotations

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.gate import Gate


class Subtree(Gate):
    """Ticks another tree with inputs of its own.

    Args:
        name: as in py_trees.
        child: the root of the tree.
        begin: writes the inputs, each time the tree starts; raises ValueError for one that has no
            value or does not fit, which fails the subtree before its first tick.
        end: gives back the outputs, when the tree has succeeded or failed; raises ValueError for
            one that does not fit, which fails the subtree.
    """

    def __init__(
        self, name: str, child: Behaviour, begin: Callable[[], None], end: Callable[[], None]
    ) -> None:
        super().__init__(name, child)
        self._begin = begin
        self._end = end

    def begin(self) -> None:
        try:
            self._begin()
        except ValueError:
            self.decorated.stop(Status.INVALID)
            raise

    def update(self) -> Status:
        status = self.decorated.status
        self.feedback_message = self.decorated.feedback_message
        if status in (Status.SUCCESS, Status.FAILURE):
            try:
                self._end()
            except ValueError as error:
                failed = self.feedback_message if status is Status.FAILURE else ""
                self.feedback_message = f"{failed}; {error}" if failed else str(error)
                return Status.FAILURE
        return status
