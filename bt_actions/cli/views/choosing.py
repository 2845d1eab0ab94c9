"""The choice of nodes to show, where not all have room. Draws nothing."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator

from bt_actions.story.state import State


def choose(
    state: State, nodes: list[int], position: dict[int, int], running: list[int], most: int
) -> tuple[list[int], int, dict[int, int]]:
    """Return at most `most` lines' worth of nodes in tree order, and how many are left out.

    The third value has, for each running node, the lowest node above it, if not shown, where its
    branch leaves another one.

    Running nodes come first. Then, of the nodes above them, those that tell running branches apart,
    then the others, then the nodes behind each running one, then those before the first. One line
    is kept for the number of nodes left out. The cost does not grow with the tree.
    """
    if len(nodes) <= most:
        return nodes, 0, {}
    chains = _branches(state, running, position)
    forks = _fork_of(chains)
    chosen: set[int] = set()
    for node in itertools.chain(
        (chain[0] for chain in chains),
        (forks[chain[0]] for chain in chains if chain[0] in forks),
        (each for rank in itertools.zip_longest(*chains) for each in rank if each is not None),
        _near(nodes, [position[chain[0]] for chain in chains] or [0], most),
    ):
        if len(chosen) >= most - 1:
            break
        chosen.add(node)
    shown = sorted(chosen, key=position.__getitem__)
    unseen = {tip: fork for tip, fork in forks.items() if fork not in chosen}
    return shown, len(nodes) - len(shown), unseen


def _branches(state: State, running: list[int], position: dict[int, int]) -> list[list[int]]:
    """Return the running tips in tree order, each with all nodes above it, upwards."""
    active = set(running)
    tips = [node for node in running if active.isdisjoint(state.nodes[node].children)]
    tips.sort(key=position.__getitem__)
    return [[tip, *(above.node.id for above in state.above(tip))] for tip in tips]


def _fork_of(chains: list[list[int]]) -> dict[int, int]:
    """Return for each tip the lowest node above it where its branch leaves another one."""
    branches_at = Counter(node for chain in chains for node in chain)
    forks: dict[int, int] = {}
    for chain in chains:
        for node, above in itertools.pairwise(chain):
            if branches_at[node] < branches_at[above]:
                if node != chain[0]:
                    forks[chain[0]] = node
                break
    return forks


def _near(nodes: list[int], places: list[int], most: int) -> Iterator[int]:
    """Yield the nodes behind each place in turn, then those before the first, the nearest first."""
    for distance in range(most):
        yield from (nodes[at + distance] for at in places if at + distance < len(nodes))
    for at in range(places[0] - 1, max(-1, places[0] - most), -1):
        yield nodes[at]
