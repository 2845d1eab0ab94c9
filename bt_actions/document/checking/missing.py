"""Later children of a fallback that fail for the value that an earlier one lacked: BT320.

A fallback's later child is there for the failure of an earlier one. A node fails where it reads a
topic without a message, or a variable that nothing has written; a log does not. A later child that
reads the value in a check of its own is one of several cases, and no hazard, unless the earlier one
does nothing but ask and no other child is left. Behind a child that asks `known`, nothing is one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from bt_actions.document.checking.checker import Checker
from bt_actions.document.findings import Related
from bt_actions.document.language.values import Computed, computed_in
from bt_actions.document.reading.tree import TreeNode, settings_of
from bt_actions.document.reading.unread import Doubts
from bt_actions.document.yaml.nodes import span_of

__all__ = ["find_missing"]

_ASKS = frozenset({"check", "while"})
_AT_ONCE = _ASKS | {"set", "publish"}
"""Kinds that fail for a missing value, and for hardly anything else."""
_CONDITIONS = frozenset({"sequence", "fallback", "check", "wait_until", "timeout"})
_DOES_WITHOUT = frozenset({"invert", "force_success"})
"""Kinds that succeed where their child has failed."""


class _Need(NamedTuple):
    """A read that fails a node while the variable has no value."""

    name: str
    node: TreeNode
    computed: Computed

    @property
    def asks(self) -> bool:
        return self.node.kind.name in _ASKS


_Needs = tuple[tuple[_Need, ...], frozenset[str]]
"""What a node needs, in order, and the names that have a value when it has succeeded."""


def find_missing(checker: Checker, doubts: Doubts, root: TreeNode) -> None:
    """Report the reads in later children of fallbacks that fail for what an earlier one lacked."""
    if any(node.kind.name == "fallback" for node in checker.document.nodes()):
        _Missing(checker, doubts).visit(root)


class _Missing:
    def __init__(self, checker: Checker, doubts: Doubts) -> None:
        self._checker = checker
        self._doubts = doubts
        self._known: dict[int, _Needs] = {}
        self._written: set[str] = set()
        """What nodes write that come before the one that is visited now."""
        self._there = set(checker.document.inputs)
        """What has a value whenever that node is reached."""

    def visit(self, node: TreeNode) -> None:
        """Look at a node and what is below it."""
        if node.kind.name == "fallback" and not self._doubts.below(node):
            self._look_at(node)
        self._written |= self._checker.written_by(node)
        added: set[str] = set()
        for child in node.children:
            self.visit(child)
            if node.kind.name == "sequence":
                given = self._needs(child)[1] - self._there
                added |= given
                self._there |= given
        self._there -= added

    def _look_at(self, fallback: TreeNode) -> None:
        lacked: dict[str, tuple[_Need, bool]] = {}  # and whether its branch does nothing but ask
        settled: set[str] = set()  # it was told of, or an earlier child asks whether it is known
        for child in fallback.children:
            needs = [need for need in self._needs(child)[0] if self._may_lack(need.name)]
            asks, waits = _only_asks(child), _ended_waits(child)
            last = child is fallback.children[-1]
            for need in needs:
                first, rescued = lacked.get(need.name, (None, False))
                if first is None or need.name in settled or need.node.kind.name == "wait_until":
                    continue
                if not need.asks or (rescued and not asks and last):
                    settled.add(need.name)
                    self._report(need, first)
            for need in needs:
                if need.node.kind.name in _AT_ONCE or id(need.node) in waits:
                    lacked.setdefault(need.name, (need, asks))
            for each in child.walk():
                settled.update(*(one.expression.asked for one in computed_in(each.values)))

    def _may_lack(self, name: str) -> bool:
        if name in self._there or self._doubts.mentions(name):
            return False
        checker = self._checker
        return name in checker.document.topics or (
            name in checker.variables and name not in self._written
        )

    def _needs(self, node: TreeNode) -> _Needs:
        found = self._known.get(id(node))
        if found is None:
            found = self._known[id(node)] = self._work_out(node)
        return found

    def _work_out(self, node: TreeNode) -> _Needs:
        needs = [*self._own(node)]
        there = {*self._checker.written_by(node), *(need.name for need in needs)}
        kind = node.kind.name
        if kind in ("check", "wait_until"):
            there.update(*(one.expression.names for one in computed_in(node.values.get(kind))))
        inner = [self._needs(child) for child in node.children]
        if kind == "fallback" and inner:
            in_all = [{need.name for need in each} for each, _ in inner]
            last, _ = inner[-1]
            needs += [need for need in last if all(need.name in names for names in in_all)]
            there |= frozenset.intersection(*(given for _, given in inner))
        elif kind not in _DOES_WITHOUT and (kind != "parallel" or "policy" not in node.values):
            for each, given in inner:
                needs += [need for need in each if need.name not in there]
                there |= given
        return tuple(needs), frozenset(there)

    def _own(self, node: TreeNode) -> Iterator[_Need]:
        values = settings_of(node, self._checker.document) if node.is_action else node.values
        for computed in computed_in(values.get(node.kind.reads)):
            for name in dict.fromkeys(computed.expression.variables):
                if name not in computed.expression.asked:
                    yield _Need(name, node, computed)

    def _report(self, need: _Need, first: _Need) -> None:
        source, at = self._checker.source, span_of(need.node.key)
        if any(one is need.computed for one in computed_in(need.node.values)):  # not the action's
            spans = dict(need.computed.expression.variable_spans)
            at = need.computed.span(source, *spans[need.name])
        source.report(
            "BT320", at, f"this fails, too, while ${need.name} has no value",
            hint=f"read it behind a 'check: known(${need.name})', and have a branch without it",
            related=Related(first.node.place, "as this does"),
        )  # fmt: skip


def _ended_waits(branch: TreeNode) -> set[int]:
    """Return the ids of the nodes that wait until a condition holds, or a timeout ends them."""
    found: set[int] = set()
    waiting = [(branch, False)]
    while waiting:
        node, ends = waiting.pop()
        ends = ends or node.kind.name == "timeout"
        if node.kind.name == "wait_until" and (ends or "timeout" in node.values):
            found.add(id(node))
        waiting += [(child, ends) for child in node.children]
    return found


def _only_asks(node: TreeNode) -> bool:
    return {each.kind.name for each in node.walk()} <= _CONDITIONS
