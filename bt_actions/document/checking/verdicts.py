"""The ends of a node, and the time it may take, as far as the document tells."""

from __future__ import annotations

from bt_actions.document.language.keys import GATES
from bt_actions.document.language.kinds import EITHER, Can, Group
from bt_actions.document.language.shapes import Record
from bt_actions.document.reading.tree import Document, TreeNode, settings_of


class Verdicts:
    """Verdicts on the nodes of a document, given by their kinds; each is worked out once.

    With `at_once` a verdict is about a tick in which a node begins and ends, and in which nothing
    fails for lack of a value.
    """

    def __init__(self, *, at_once: bool = False) -> None:
        self._at_once = at_once
        self._known: dict[int, Can] = {}
        self._budgets: dict[int, float] = {}

    def of(self, node: TreeNode) -> Can:
        """Return how a node can end."""
        found = self._known.get(id(node))
        if found is None:
            found = self._known[id(node)] = self._work_out(node)
        return found

    def _work_out(self, node: TreeNode) -> Can:
        kind = node.kind
        if self._at_once and kind.begun:
            return Can(False, False)
        below = _below(node)
        if not below and (kind.includes or kind.group is not Group.LEAF):
            return EITHER
        if not self._at_once and not GATES.keys().isdisjoint(node.values):
            return EITHER
        return kind.ends(node.values, [self.of(child) for child in below], self._at_once)

    def budget(self, node: TreeNode, document: Document) -> float:
        """Return the sum of a node's deadlines and pauses in seconds.

        `document` is the one that the node stands in.
        """
        found = self._budgets.get(id(node))
        if found is None:
            found = self._budgets[id(node)] = self._add_up(node, document)
        return found

    def _add_up(self, node: TreeNode, document: Document) -> float:
        kind, inner = node.kind, node.included or document
        below = [self.budget(child, inner) for child in _below(node)]
        if below:
            return kind.seconds(node.values, below)
        values = settings_of(node, document) if node.is_action else node.values
        if "timeout" not in kind.keys:
            limit = values.get(kind.name)
            return limit if isinstance(limit, float) else 0.0
        limit, form = values.get("timeout"), kind.keys["timeout"].shape
        if isinstance(form, Record):  # a bare duration is the longest deadline
            limit = limit.get(form.short) if isinstance(limit, dict) else None
        return of_tries(limit if isinstance(limit, float) else 0.0, values.get("retry"))


def _below(node: TreeNode) -> list[TreeNode]:
    """Return a node's children, or the root of the tree that it stands for."""
    root = node.included.root if node.included is not None else None
    return node.children if root is None else [root]


def of_rounds(each: float, count: int) -> float:
    """Return the seconds of so many rounds."""
    return each * float(min(count, 10**12))  # no arithmetic overflows with this


def of_tries(each: float, retry: object) -> float:
    """Return the seconds of all tries and the pauses between; 0 where a try has no limit."""
    if not isinstance(retry, dict) or each == 0.0:
        return each
    attempts = retry.get("attempts", 1)
    if not isinstance(attempts, int):
        return each
    pause: float = retry.get("backoff", 0.0)
    factor: float = retry.get("factor", 2.0)
    longest: float = retry.get("max_backoff", 60.0)
    total, left = of_rounds(each, attempts), attempts - 1
    if not pause:
        return total
    while left > 0 and pause < longest and factor > 1.001:
        total, pause, left = total + pause, pause * factor, left - 1
    return total + of_rounds(min(pause, longest), left)
