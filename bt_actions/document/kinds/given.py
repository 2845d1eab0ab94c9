"""Names for the files of kinds, which must not import them: types for annotations, and behaviours.

Reading and checking import no behaviour, so that `bt-actions check` stays quick. A module of
behaviours is imported when the `build` of a kind first uses it. The types exist only for mypy.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import py_trees
    from py_trees.behaviour import Behaviour

    from bt_actions.behaviours import (
        action,
        composites,
        decorators,
        leaves,
        leaving,
        own,
        parallel,
        reading,
        run_tree,
        service,
        topics,
    )
    from bt_actions.document.building import build, parts
    from bt_actions.document.building.context import Context
    from bt_actions.document.checking.checker import Checker
    from bt_actions.document.checking.hazards import Hazards
    from bt_actions.document.reading.tree import TreeNode
else:
    Behaviour = Checker = Context = Hazards = TreeNode = object

    class _Later:
        def __init__(self, module: str) -> None:
            self._module = module

        def __getattr__(self, name: str) -> object:
            value = getattr(import_module(self._module), name)
            setattr(self, name, value)  # the next read finds the attribute
            return value

    py_trees = _Later("py_trees")
    build, parts = (_Later(f"bt_actions.document.building.{name}") for name in ("build", "parts"))
    action, composites, decorators, leaves, leaving, parallel, reading, run_tree, service = (
        _Later(f"bt_actions.behaviours.{name}")
        for name in (
            "action", "composites", "decorators", "leaves", "leaving", "parallel",
            "reading", "run_tree", "service",
        )
    )  # fmt: skip
    own, topics = (_Later(f"bt_actions.behaviours.{name}") for name in ("own", "topics"))

__all__ = [
    "Behaviour", "Checker", "Context", "Hazards", "TreeNode", "action", "build", "composites",
    "decorators", "leaves", "leaving", "own", "parallel", "parts", "py_trees", "reading",
    "run_tree", "service", "topics",
]  # fmt: skip
