"""Variables that are read before anything can have written them, in the order of ticks: BT302.

Follows what is written by the time a node has succeeded, and by the time it has failed: a sequence
goes on with the first, a fallback with the second. Where several rounds or branches may have
written a name, nothing is claimed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence, Set
from functools import cached_property
from itertools import chain

from bt_actions.document.checking.checker import Checker
from bt_actions.document.findings import Span
from bt_actions.document.language.values import Computed
from bt_actions.document.reading.tree import TreeNode
from bt_actions.document.reading.unread import Doubts
from bt_actions.document.yaml.nodes import span_of

__all__ = ["find_early_reads"]

_NOTHING: frozenset[str] = frozenset()
_LOOPS = frozenset({"retry", "repeat", "for_each", "while", "parallel"})
_STRAIGHT = frozenset({"sequence", "timeout", "while", "run_once"})
"""Go on when a child succeeds, and fail with it."""
_TURNED = frozenset({"fallback", "invert"})
"""Go on when a child fails. Of all other kinds nothing is known."""


_Written = tuple[Set[str], Set[str]]
"""Names that may have been written below a node when it has succeeded, and when it has failed.

What has been written meanwhile is in both: a node that is stopped has written no more than if it
had failed.
"""
_SILENT: _Written = (_NOTHING, _NOTHING)


def find_early_reads(checker: Checker, doubts: Doubts, root: TreeNode) -> None:
    """Report the reads that no write can come before."""
    _Order(checker, doubts).visit(root, _NOTHING, _NOTHING)


class _Order:
    def __init__(self, checker: Checker, doubts: Doubts) -> None:
        self._checker = checker
        self._doubts = doubts
        self._known = {*checker.document.inputs, *checker.document.topics}
        """What may have been written when the node is reached that is visited now."""
        self._passed: set[str] = set()
        """What the nodes write that were visited already."""
        self._own = {
            node: frozenset([write.name for write in writes])
            for node, writes in checker.writes.items()
        }
        """What each node writes, by its id."""
        actions = checker.document.actions.items()
        self._shared: dict[str | None, Sequence[Computed]] = {
            name: checker.reads.get(id(declared), ()) for name, declared in actions
        }
        """What is read by the declaration of an action."""

    @cached_property
    def _writers(self) -> Counter[str]:
        """How many nodes write a name."""
        return Counter(chain.from_iterable(self._own.values()))

    def visit(self, node: TreeNode, around: frozenset[str], later: frozenset[str]) -> _Written:
        """Look at a node and what is below it.

        `around` is what loops and branches around it may have written, `later` what they write only
        when nothing in their first round has failed.
        """
        own = self._own.get(id(node), _NOTHING)
        self._reads(node, own, around)
        if own:
            self._passed |= own
        elif not node.children:
            return _SILENT
        kind = node.kind.name
        if not node.children:
            return own, own if kind == "subtree" else _NOTHING
        if kind == "repeat":  # a read in its first round has nothing yet
            later |= self._below(node)
        elif kind in _LOOPS or node.values.get("memory") is False:
            around |= self._below(node)
        if kind not in ("repeat", "sequence"):  # who may go on after a read that failed
            around |= later
        if not own:
            return self._children(node, kind, around, later)
        added = own - self._known  # a loop's item
        self._known |= added
        succeeded, failed = self._children(node, kind, around, later)
        self._known -= added
        return succeeded | own, failed | own

    def _children(
        self, node: TreeNode, kind: str, around: frozenset[str], later: frozenset[str]
    ) -> _Written:
        added: set[str] = set()
        onward: set[str] = set()  # written when the next child is reached, or there is none left
        ended: set[str] = set()  # written when a child ends the node
        succeeded: Set[str] = _NOTHING
        for child in node.children:
            if succeeded:
                ended |= succeeded
            succeeded, failed = self.visit(child, around, later)
            if not (succeeded or failed):
                continue
            if kind in _TURNED:
                succeeded, failed = failed, succeeded
            elif kind not in _STRAIGHT:
                succeeded = failed = succeeded | failed
            ended |= failed
            if succeeded:
                onward |= succeeded
                added |= succeeded - self._known
                self._known |= succeeded
        self._known -= added
        return (ended, onward) if kind == "fallback" else (onward, ended)

    def _below(self, node: TreeNode) -> frozenset[str]:
        return _NOTHING.union(*(self._own.get(id(inner), _NOTHING) for inner in node.walk()))

    def _reads(self, node: TreeNode, own: frozenset[str], around: frozenset[str]) -> None:
        for read in self._checker.reads.get(id(node), ()):
            if self._known.issuperset(read.expression.variables):
                continue
            known = self._known | read.expression.asked
            for name, at in read.expression.variable_spans:
                if name not in known and not self._may_be_written(name, own, around):
                    span = read.span(self._checker.source, *at)
                    self._report(name, span, f"nothing has written ${name} when this is read")
        for read in self._shared.get(node.alias, ()):
            known = self._known | read.expression.asked
            for name in read.expression.variables:
                if name not in known and not self._may_be_written(name, own, around):
                    text = f"nothing has written ${name} when {node.alias!r} reads it here"
                    self._report(name, span_of(node.key), text)

    def _may_be_written(self, name: str, own: frozenset[str], around: frozenset[str]) -> bool:
        doubts = self._doubts
        if name not in self._checker.variables:
            return True
        if name in around and (name not in own or self._writers[name] > 1):
            return True
        return doubts.unknown_action or doubts.mentions(name)

    def _report(self, name: str, span: Span, message: str) -> None:
        hint = None
        if name in self._passed:
            hint = "what writes it does so when it succeeds, and has not when this is reached"
        self._checker.source.report("BT302", span, message, hint=hint)
