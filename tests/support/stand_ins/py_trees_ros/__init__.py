"""A stand-in for py_trees_ros, which is on no package index.

The stand-in has the two classes that docs/tutorials/leaf_by_leaf.md names, with the arguments,
methods and attributes that py_trees_ros 2 gives them, and no others. A process puts the folder
above on its path.
"""

from . import action_clients, trees

__all__ = ["action_clients", "trees"]
