"""What one tick of a tree has changed."""

from __future__ import annotations

import gc
import weakref

import py_trees
from py_trees.composites import Sequence

from bt_actions.behaviours.decorators import Repeat
from tests.support.trees import unheard


def test_a_class_that_is_made_of_one_may_look_at_more() -> None:
    class Curious(Repeat):
        pass

    for make, watched in ((Repeat, False), (Curious, True)):
        visitor = unheard()
        node = make("R", py_trees.behaviours.Success("A"), None)
        node.tick_once()
        visitor.run(node)
        visitor.finish()
        assert visitor.watching is watched


def test_what_was_pruned_in_a_run_is_not_kept() -> None:
    root = Sequence("root", memory=False)
    ticking = py_trees.trees.BehaviourTree(root)
    visitor = unheard()
    ticking.visitors.append(visitor)

    def tick() -> None:
        ticking.tick()
        visitor.finish()
        visitor.forget_others(set(root.iterate()))

    pruned = []
    for number in range(5):
        leaf = py_trees.behaviours.Running(f"leaf {number}")
        ticking.insert_subtree(leaf, root.id, 0)
        tick()
        ticking.prune_subtree(leaf.id)
        tick()
        pruned.append(weakref.ref(leaf))
        del leaf
    gc.collect()
    assert [each() for each in pruned] == [None] * 5
