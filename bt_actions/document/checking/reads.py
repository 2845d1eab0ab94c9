"""Reads of variables without a value: BT302 and BT320.

BT302 goes by the order of ticks. The check keeps two sets of written names for a node: those after
its success, and those after its failure. A sequence goes on with the first set, a fallback with the
second. A name that several rounds or branches may have written is left alone.

BT320 is about a fallback: a later child reads the value whose lack made an earlier child fail, and
fails for the same reason. A node fails where it reads a topic without a message, or a variable
without a value; a log does not. A later child that reads the value in a check of its own is one of
several cases, and no hazard, unless the earlier child is only a check and no other child is left.
Behind a child that asks `known`, no read is a hazard.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence, Set
from functools import cached_property
from itertools import chain
from typing import NamedTuple

from bt_actions.document.checking.checker import Checker
from bt_actions.document.findings import Related, Span
from bt_actions.document.language.kinds import End, Kind
from bt_actions.document.language.values import Computed, computed_in
from bt_actions.document.reading.tree import TreeNode, always_there, settings_of
from bt_actions.document.yaml.nodes import span_of

_NOTHING: frozenset[str] = frozenset()
_DOES_WITHOUT = (End.FAILURE, End.ANY)
"""Values of `goes_on` with which a child's failure is no failure of the decorator."""
_Written = tuple[Set[str], Set[str]]
"""Names that a node and those below may have written: after its success, and after its failure.

A stopped node counts as a failed one: both sets hold the names written meanwhile.
"""
_SILENT: _Written = (_NOTHING, _NOTHING)


def find_early_reads(checker: Checker, root: TreeNode) -> None:
    """Report the reads that no write can precede."""
    _Order(checker).visit(root, _NOTHING, _NOTHING)


class _Order:
    def __init__(self, checker: Checker) -> None:
        self._checker = checker
        self._doubts = checker.doubts
        document = checker.document
        self._known = {*document.inputs, *document.topics, *always_there(document)}
        """Names that may have a value when the visit reaches the current node."""
        self._passed: set[str] = set()
        """Names that visited nodes write."""
        actions = checker.document.actions.items()
        self._shared: dict[str | None, Sequence[Computed]] = {
            name: checker.reads.get(id(declared), ()) for name, declared in actions
        }
        """The expressions in the declaration of each action."""

    @cached_property
    def _writers(self) -> Counter[str]:
        """The number of nodes that write each name."""
        own = map(self._checker.written_by, self._checker.document.nodes())
        return Counter(chain.from_iterable(own))

    def visit(self, node: TreeNode, around: frozenset[str], later: frozenset[str]) -> _Written:
        """Visit a node and the nodes below it.

        `around` are the names that loops and branches around the node may have written. `later` are
        names that these write only after a first round without a failure.
        """
        own = self._checker.written_by(node)
        self._reads(node, own, around)
        if own:
            self._passed |= own
        elif not node.children:
            return _SILENT
        kind = node.kind
        if not node.children:
            writes = self._checker.writes[id(node)]
            meanwhile = {one.name for one in writes if one.root == "feedback"}
            return own, own if kind.includes else meanwhile
        if kind.again is End.SUCCESS:  # a read in its first round has nothing yet
            later |= self._below(node)
        elif (
            kind.again is not None
            or node.values.get("memory") is False
            or node.values.get("in_turn") is True
        ):
            around |= self._below(node)
        if End.SUCCESS not in (kind.again, kind.in_turn):  # may go on after a read that failed
            around |= later
        if not own:
            return self._children(node, kind, around, later)
        added = own - self._known  # a loop's item
        self._known |= added
        succeeded, failed = self._children(node, kind, around, later)
        self._known -= added
        return succeeded | own, failed | own

    def _children(
        self, node: TreeNode, kind: Kind, around: frozenset[str], later: frozenset[str]
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
            if kind.goes_on is End.FAILURE:
                succeeded, failed = failed, succeeded
            elif kind.goes_on is not End.SUCCESS:
                succeeded = failed = succeeded | failed
            ended |= failed
            if succeeded:
                onward |= succeeded
                added |= succeeded - self._known
                self._known |= succeeded
        self._known -= added
        return (ended, onward) if kind.in_turn is End.FAILURE else (onward, ended)

    def _below(self, node: TreeNode) -> frozenset[str]:
        return _NOTHING.union(*map(self._checker.written_by, node.walk()))

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
            hint = "its writer writes on success, and has not succeeded when this node begins"
        self._checker.source.report("BT302", span, message, hint=hint)


class _Need(NamedTuple):
    """A read that fails a node while the variable has no value."""

    name: str
    node: TreeNode
    computed: Computed

    @property
    def asks(self) -> bool:
        return self.node.kind.asks and not self.node.kind.slow

    @property
    def waits(self) -> bool:
        return self.node.kind.asks and bool(self.node.kind.slow)


_Needs = tuple[tuple[_Need, ...], frozenset[str]]
"""The needs of a node, in order, and the names with a value after its success."""


def find_missing(checker: Checker, root: TreeNode) -> None:
    """Report reads of later children in fallbacks that fail for the lack of an earlier child."""
    if any(node.kind.in_turn is End.FAILURE for node in checker.document.nodes()):
        _Missing(checker).visit(root)


class _Missing:
    def __init__(self, checker: Checker) -> None:
        self._checker = checker
        self._doubts = checker.doubts
        self._known: dict[int, _Needs] = {}
        self._written: set[str] = set()
        """Names that nodes before the current one write."""
        self._there = {*checker.document.inputs, *always_there(checker.document)}
        """Names that have a value whenever the visit reaches the current node."""

    def visit(self, node: TreeNode) -> None:
        """Visit a node and the nodes below it."""
        if node.kind.in_turn is End.FAILURE and not self._doubts.below(node):
            self._look_at(node)
        self._written |= self._checker.written_by(node)
        added: set[str] = set()
        for child in node.children:
            self.visit(child)
            if node.kind.in_turn is End.SUCCESS:
                given = self._needs(child)[1] - self._there
                added |= given
                self._there |= given
        self._there -= added

    def _look_at(self, fallback: TreeNode) -> None:
        lacked: dict[str, tuple[_Need, bool]] = {}  # and whether its branch does nothing but ask
        settled: set[str] = set()  # reported, or asked for by `known` before
        for child in fallback.children:
            needs = [need for need in self._needs(child)[0] if self._may_lack(need.name)]
            asks, waits = _only_asks(child), _ended_waits(child)
            last = child is fallback.children[-1]
            for need in needs:
                first, rescued = lacked.get(need.name, (None, False))
                if first is None or need.name in settled or need.waits:
                    continue
                if not need.asks or (rescued and not asks and last):
                    settled.add(need.name)
                    self._report(need, first)
            for need in needs:
                if need.asks or need.node.kind.computes or id(need.node) in waits:
                    lacked.setdefault(need.name, (need, asks))
            for each in child.walk():
                settled.update(*(one.expression.asked for one in computed_in(each.values)))

    def _may_lack(self, name: str) -> bool:
        if name in self._there or self._doubts.mentions(name):
            return False
        checker = self._checker
        topic = checker.document.topics.get(name)
        if topic is not None:
            return "default" not in topic.values
        return name in checker.variables and name not in self._written

    def _needs(self, node: TreeNode) -> _Needs:
        found = self._known.get(id(node))
        if found is None:
            found = self._known[id(node)] = self._work_out(node)
        return found

    def _work_out(self, node: TreeNode) -> _Needs:
        needs = [*self._own(node)]
        there = {*self._checker.written_by(node), *(need.name for need in needs)}
        kind = node.kind
        if kind.only_asks:
            asked = computed_in(node.values.get(kind.name))
            there.update(*(one.expression.variables for one in asked))
        inner = [self._needs(child) for child in node.children]
        if kind.in_turn is End.FAILURE and inner:
            in_all = [{need.name for need in each} for each, _ in inner]
            last, _ = inner[-1]
            needs += [need for need in last if all(need.name in names for names in in_all)]
            there |= frozenset.intersection(*(given for _, given in inner))
        elif (kind.in_turn or kind.goes_on not in _DOES_WITHOUT) and "policy" not in node.values:
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
        ends = ends or node.kind.bounds
        if node.kind.only_asks and node.kind.slow and (ends or "timeout" in node.values):
            found.add(id(node))
        waiting += [(child, ends) for child in node.children]
    return found


def _only_asks(node: TreeNode) -> bool:
    kinds = {each.kind for each in node.walk()}
    return all(kind.only_asks or kind.in_turn or kind.bounds for kind in kinds)
