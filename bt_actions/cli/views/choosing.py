"""Which nodes of a tree to show where there is not room for all. Draws nothing."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator

from py_trees.behaviour import Behaviour


def choose(
    nodes: list[Behaviour],
    position: dict[object, int],
    running: list[Behaviour],
    most: int,
) -> tuple[list[Behaviour], int]:
    """Return at most `most` lines' worth of nodes in tree order, and how many are left out.

    First what runs, then of what holds it that which tells running branches apart, then the rest
    of what holds it, then what comes next to it, then what is nearest in the tree. One line is
    kept for saying how many are left out. The cost does not grow with the tree.
    """
    if len(nodes) <= most:
        return nodes, 0
    room = most - 1
    chosen: dict[object, Behaviour] = {}
    chains = branches(running, position)

    def take(node: Behaviour) -> None:
        if len(chosen) < room and node.id in position:
            chosen.setdefault(node.id, node)

    for chain in chains:
        take(chain[0])
    forks = fork_of(chains)
    for chain in chains:
        if (fork := forks.get(chain[0].id)) is not None:
            take(fork)
    for rank in range(max((len(chain) for chain in chains), default=0)):
        for chain in chains:
            if rank < len(chain):
                take(chain[rank])
        if len(chosen) >= room:
            break
    for chain in chains:
        for node in chain:
            for sibling in _after(node):
                if len(chosen) >= room:
                    break
                take(sibling)
    for node in _around(nodes, position[chains[0][0].id] if chains else 0, 8 * most):
        if len(chosen) >= room:
            break
        take(node)
    shown = sorted(chosen.values(), key=lambda node: position[node.id])
    return shown, len(nodes) - len(shown)


def branches(running: list[Behaviour], position: dict[object, int]) -> list[list[Behaviour]]:
    """Return what runs at the tips, in tree order, each with all that holds it, upwards."""
    active = {node.id for node in running}
    tips = [node for node in running if not any(child.id in active for child in node.children)]
    tips.sort(key=lambda node: position[node.id])
    return [list(_upwards(tip)) for tip in tips]


def fork_of(chains: list[list[Behaviour]]) -> dict[object, Behaviour]:
    """Return for each tip the lowest node above it where its branch leaves another one."""
    below = Counter(node.id for chain in chains for node in chain)
    forks: dict[object, Behaviour] = {}
    for chain in chains:
        for node, above in itertools.pairwise(chain):
            if below[node.id] < below[above.id]:
                if node is not chain[0]:
                    forks[chain[0].id] = node
                break
    return forks


def _around(nodes: list[Behaviour], at: int, most: int) -> Iterator[Behaviour]:
    """Yield nodes by their distance from place `at`, those after it first."""
    for distance in range(1, most):
        if at + distance < len(nodes):
            yield nodes[at + distance]
        if at - distance >= 0:
            yield nodes[at - distance]


def _upwards(node: Behaviour | None) -> list[Behaviour]:
    chain = []
    while node is not None:
        chain.append(node)
        node = node.parent
    return chain


def _after(node: Behaviour) -> list[Behaviour]:
    if node.parent is None:
        return []
    siblings = node.parent.children
    return list(siblings[siblings.index(node) + 1 :])


def is_below(node: Behaviour, above: Behaviour) -> bool:
    """Return whether `node` is somewhere below `above`."""
    return any(other is above for other in _upwards(node.parent))
