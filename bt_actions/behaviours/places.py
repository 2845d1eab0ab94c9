"""The place of a behaviour in its tree."""

from __future__ import annotations

from collections.abc import Iterator
from types import FrameType

from py_trees.behaviour import Behaviour


def root_of(behaviour: Behaviour) -> Behaviour:
    """Return the root of the tree that the behaviour is in."""
    while behaviour.parent is not None:
        behaviour = behaviour.parent
    return behaviour


def path_of(behaviour: Behaviour) -> tuple[str, ...]:
    """Return the names from the root down to the behaviour."""
    names = [behaviour.name]
    while behaviour.parent is not None:
        behaviour = behaviour.parent
        names.append(behaviour.name)
    return tuple(reversed(names))


def in_order(root: Behaviour) -> Iterator[Behaviour]:
    """Yield every node below and including `root`, parents first; not bounded by recursion."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        yield node
        waiting.extend(reversed(node.children))


def innermost(frame: FrameType | None) -> Behaviour | None:
    """Return the innermost behaviour with a method on the stack of this frame."""
    while frame is not None:
        if isinstance(behaviour := frame.f_locals.get("self"), Behaviour):
            return behaviour
        frame = frame.f_back
    return None


def culprit_of(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour on the way to the place where `error` was raised."""
    culprit, traceback = None, error.__traceback__
    while traceback is not None:
        candidate = traceback.tb_frame.f_locals.get("self")
        if isinstance(candidate, Behaviour):
            culprit = candidate
        traceback = traceback.tb_next
    return culprit
