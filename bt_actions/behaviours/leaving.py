"""Nodes that are left out: their parents go on as if they were not there.

py_trees has no status for that, and needs none: a left-out node has the status with which the
composite above goes on, and `left_out` tells the rest. Sequence and Selector of py_trees need no
more. Where nodes below may be left out, `Sequence` and `Fallback` here are left out themselves when
all of their children were, and so are `Invert`, `ForceSuccess`, `ForceFailure` and `RunOnce` with
their child.
"""

from __future__ import annotations

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.events.kinds import LEFT_OUT


def is_left_out(node: Behaviour) -> bool:
    """Return whether an ended node was left out."""
    return bool(getattr(node, "left_out", False))


def leave_out(node: Behaviour, why: str = "") -> Status:
    """Mark a node as left out; return the status with which its parent goes on."""
    node.left_out = True  # type: ignore[attr-defined]
    node.feedback_message = f"{LEFT_OUT}: {why}" if why else LEFT_OUT
    above = node.parent
    while isinstance(above, decorators.Decorator):
        above = above.parent
    return Status.FAILURE if isinstance(above, composites.Selector) else Status.SUCCESS


class _OfChildren:
    """A composite of py_trees that is left out where all of its children were."""

    passes_on = True
    left_out = False

    def initialise(self) -> None:
        self.left_out, self.feedback_message = False, ""

    def stop(self, new_status: Status = Status.INVALID) -> None:
        self.left_out = new_status is not Status.INVALID and all(
            map(is_left_out, self.children)  # type: ignore[attr-defined]
        )
        if self.left_out:
            new_status = leave_out(self)  # type: ignore[arg-type]
        super().stop(new_status)  # type: ignore[misc]


class Sequence(_OfChildren, composites.Sequence):
    """A sequence that may be left out."""


class Fallback(_OfChildren, composites.Selector):
    """A selector that may be left out."""


class _OfChild:
    """A decorator of py_trees that is left out where its child was."""

    passes_on = True
    left_out = False

    def update(self) -> Status:
        self.left_out = is_left_out(self.decorated)  # type: ignore[attr-defined]
        if self.left_out:
            return leave_out(self)  # type: ignore[arg-type]
        status: Status = super().update()  # type: ignore[misc]
        return status


class Invert(_OfChild, decorators.Inverter):
    """An inverter that may be left out."""


class ForceSuccess(_OfChild, decorators.FailureIsSuccess):
    """A decorator that may be left out."""


class ForceFailure(_OfChild, decorators.SuccessIsFailure):
    """A decorator that may be left out."""


class RunOnce(_OfChild, decorators.OneShot):
    """A decorator that may be left out, which does not count as its run."""

    def terminate(self, new_status: Status) -> None:
        if not self.left_out:
            super().terminate(new_status)
