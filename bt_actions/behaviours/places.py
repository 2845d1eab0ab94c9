"""Where a behaviour stands in its tree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

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


def told_apart(paths: Iterable[tuple[str, ...]]) -> dict[tuple[str, ...], str]:
    """Return for each path its name, behind as much of the path as no other one ends with."""
    texts: dict[tuple[str, ...], str] = {}
    left, size = set(paths), 1
    while left:
        ends = Counter(path[-size:] for path in left)
        done = {path for path in left if ends[path[-size:]] == 1 or size >= len(path)}
        texts |= {path: " / ".join(path[-size:]) for path in done}
        left, size = left - done, size + 1
    return texts


def culprit_of(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour on the way to where `error` was raised."""
    culprit, traceback = None, error.__traceback__
    while traceback is not None:
        candidate = traceback.tb_frame.f_locals.get("self")
        if isinstance(candidate, Behaviour):
            culprit = candidate
        traceback = traceback.tb_next
    return culprit
