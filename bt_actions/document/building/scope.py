"""The variables of one loaded tree, on py_trees' blackboard under a namespace of their own.

The blackboard is process-global and has no lock: read and write on the ticking thread only.
"""

from __future__ import annotations

import itertools
import re
from collections import deque
from collections.abc import Mapping

from py_trees.blackboard import Blackboard

_ODD = re.compile(r"[^A-Za-z0-9_]")
_LOADS = "/bt/loads"
"""The blackboard's key of its own `_Loads`: on one that was cleared they begin anew."""


class _Loads:
    """What tells the trees of a blackboard apart, and which of them are gone. Atomic steps only."""

    def __init__(self) -> None:
        self.numbers = itertools.count(1)
        self.gone: deque[str] = deque()
        """Prefixes of which no scope is left; the collector may come in the middle of a tick."""


class Scope:
    """Names of a tree and where their values lie; `topics` are read before the blackboard."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self._outer: Scope | None = None
        self._gone: deque[str] | None = None
        self._children: dict[str, int] = {}

    def __repr__(self) -> str:
        return f"<Scope {self.prefix}>"

    @classmethod
    def of_load(cls, tree: str) -> Scope:
        """The scope of a tree that is loaded now: no other load has the same.

        Its variables are forgotten at a later load, when nothing of the tree is left.
        """
        loads = Blackboard.storage.setdefault(_LOADS, _Loads())
        while True:
            try:
                prefix = f"{loads.gone.popleft()}/"
            except IndexError:
                break
            for key in [key for key in list(Blackboard.storage) if key.startswith(prefix)]:
                Blackboard.unset(key)
            for key in [key for key in list(Blackboard.metadata) if key.startswith(prefix)]:
                Blackboard.metadata.pop(key, None)
        scope = cls(f"/bt/{_safe(tree)}/{next(loads.numbers)}")
        scope._gone = loads.gone
        return scope

    def __del__(self) -> None:
        if self._gone is not None:
            self._gone.append(self.prefix)

    def inner(self, tree: str) -> Scope:
        """The scope of a tree included in this one."""
        name = _safe(tree)
        number = self._children[name] = self._children.get(name, 0) + 1
        scope = Scope(f"{self.prefix}/{name}_{number}")
        scope._outer = self  # which lives as long, and so do the variables
        return scope

    def key(self, name: str) -> str:
        """The blackboard key of a variable."""
        return f"{self.prefix}/{name}"

    def read(self, name: str) -> object:
        """The value of a variable. Raises KeyError when it has none."""
        return Blackboard.storage[self.key(name)]

    def write(self, name: str, value: object) -> None:
        """Give a variable a value."""
        Blackboard.set(self.key(name), value)

    def write_all(self, values: Mapping[str, object]) -> None:
        """Give several variables their values."""
        for name, value in values.items():
            self.write(name, value)

    def clear(self, name: str) -> None:
        """Take a variable's value away, if it has one."""
        Blackboard.unset(self.key(name))


def _safe(name: str) -> str:
    return _ODD.sub("_", name) or "tree"
