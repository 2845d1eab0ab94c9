"""Hazards: correct trees that are likely to go wrong on a robot. Each one is a coded warning.

The check looks at one document, and also at its included trees where a hazard spans both. The
hazards of single kinds are in `document/kinds/`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

from bt_actions.document.checking.checker import Checker
from bt_actions.document.checking.reads import find_early_reads, find_missing
from bt_actions.document.checking.server_names import inputs_in_names
from bt_actions.document.checking.verdicts import Verdicts
from bt_actions.document.findings import Related
from bt_actions.document.language.keys import GATES
from bt_actions.document.language.kinds import Can, End, Group
from bt_actions.document.language.values import Computed, computed_in
from bt_actions.document.reading.tree import (
    SAVES,
    Declared,
    Document,
    TreeNode,
    settings_of,
    shared_settings,
)
from bt_actions.document.reading.unread import Doubts
from bt_actions.document.yaml.nodes import Mapping as YamlMapping
from bt_actions.document.yaml.nodes import Node, span_of


def find_hazards(checker: Checker) -> None:
    """Report the hazards of a checked document, but for those that a doubt makes uncertain."""
    checker.doubts = Doubts(checker.document)  # anew: the checker found more
    if checker.document.root is not None:
        Hazards(checker).look(checker.document.root)


class Hazards:
    """The hazards of a document, with answers for the kinds of its nodes."""

    def __init__(self, checker: Checker) -> None:
        self.checker = checker
        self.doubts = checker.doubts
        self.document: Document = checker.document
        self.source = checker.source
        self._report = checker.source.report
        self.verdicts = Verdicts()
        self._at_once = Verdicts(at_once=True)
        self.held: dict[tuple[int, str], dict[str, TreeNode]] = {}
        """The resources of included trees (`resources_below`)."""
        self._slow: dict[int, bool] = {}
        self._above: dict[int, TreeNode] = {}
        self._anew: dict[int, TreeNode | None] = {}
        names = (None, *checker.document.actions)
        self._bounded = {one for one in names if _bounds(shared_settings(one, checker.document))}
        """Actions whose goals have a deadline in every node; None: all actions without a name."""
        self._unbounded: dict[str, TreeNode] = {}
        self._used: set[str] = set()

    def look(self, root: TreeNode) -> None:
        self._walk(root, bounded=False)
        self._result_timeouts()
        find_early_reads(self.checker, root)
        find_missing(self.checker, root)
        self._unused()

    def _walk(self, root: TreeNode, *, bounded: bool) -> None:
        loops: dict[str, TreeNode] = {}
        stack = [(root, bounded, loops)]
        while stack:
            node, inside, around = stack.pop()
            kind = node.kind
            self._used.add(node.alias or node.key.text)
            if node.is_action and not inside:
                self._look_at_action(node)
            if node.is_action:
                self._follows(node)
            for key in GATES:
                if isinstance(condition := node.values.get(key), Computed):
                    self.constant(condition)
            if not node.children:
                continue
            if kind.warn is not None:
                kind.warn(self, node, inside)
            if kind.in_turn is not None and not node.values.get("in_turn"):
                self._unreachable(node, kind.in_turn)
                if node.values.get("memory") is False:
                    self._reactive(node, kind.in_turn)
            if writes := self.checker.writes.get(id(node), ()):
                self._taken(node, around)
                around = around | {write.name: node for write in writes}
            inside = inside or kind.bounds
            stack += [(child, inside, around) for child in reversed(node.children)]

    # BT301

    def _look_at_action(self, node: TreeNode) -> None:
        if node.alias in self._bounded or _bounds(node.values):
            return
        if self.doubts.below(node):
            return
        if node.alias is not None:
            self._unbounded.setdefault(node.alias, node)
        else:
            self._no_result_timeout(node.key, f"{node.name or 'this action'} may take for ever")

    def _no_result_timeout(self, at: Node, message: str) -> None:
        hint = "timeout: 30 s, or {result: none} where it is meant"
        self._report("BT301", span_of(at), message, hint=hint)

    def _result_timeouts(self) -> None:
        for name, node in self._unbounded.items():
            declared = self.document.actions.get(name)
            own = declared is not None and declared.source is self.source
            at = declared.key if own and declared is not None else node.key
            self._no_result_timeout(at, f"{name!r} has no result timeout: it may take for ever")

    # BT324

    def _follows(self, node: TreeNode) -> None:
        """Report a goal that is to follow changes, and reads nothing that could change."""
        shared = shared_settings(node.alias, self.document)
        how = node.values.get("on_change") or shared.get("on_change", "ignore")
        if how == "ignore" or self.doubts.own(node):
            return
        settings = settings_of(node, self.document)
        reads = (each.expression.variables for each in computed_in(settings.get("goal")))
        if not any(reads):
            at = node.written.get("on_change", node.key)
            self._report("BT324", span_of(at), "this goal reads no variable, and never changes")

    # BT305, BT306

    def _unreachable(self, node: TreeNode, onward: End) -> None:
        for child, after in zip(node.children, node.children[1:], strict=False):
            if not _can(self.verdicts.of(child), onward) and not self.doubts.below(child):
                how = "fails" if onward is End.FAILURE else "succeeds"
                self._report(
                    "BT305", span_of(after.key), "this child is never reached",
                    related=Related(child.place, f"this one never {how}"),
                )  # fmt: skip
                return

    def _reactive(self, node: TreeNode, onward: End) -> None:
        begun_anew = self.begin_anew(node.children, onward)
        if not begun_anew or self.doubts.below(node):
            return
        for begun in begun_anew:
            self._report(
                "BT306", span_of(begun.key),
                f"this begins again while a later child of {node.name!r} runs, and stops it",
                related=Related(node.place, "because of 'memory: false' here"),
            )  # fmt: skip

    def begin_anew(self, children: Sequence[TreeNode], onward: End) -> list[TreeNode]:
        """Return children that take time, can end so, and begin again while a later child runs."""
        slow = (self.takes_time(child) for child in children)
        last = max((at for at, takes in enumerate(slow) if takes), default=0)
        return [
            self._restarted(child) or child
            for child in children[:last]
            if _can(self.verdicts.of(child), onward) and not _can(self._at_once.of(child), onward)
        ]

    def above(self, node: TreeNode) -> TreeNode | None:
        """Return the parent of a node; None at the root."""
        if not self._above:
            for each in self.document.nodes():
                self._above |= {id(child): each for child in each.children}
        return self._above.get(id(node))

    def _restarted(self, root: TreeNode) -> TreeNode | None:
        """Return the first leaf below that takes time at each begin, or the tree that holds it."""
        if id(root) in self._anew:
            return self._anew[id(root)]
        found: TreeNode | None = None
        stack = [root]
        while stack and found is None:
            node = stack.pop()
            inner = node.included.root if node.included is not None else None
            if node.kind.begun or (inner is not None and self._restarted(inner)):
                found = node
            elif not node.kind.once:
                stack.extend(reversed(node.children))
        self._anew[id(root)] = found
        return found

    def takes_time(self, node: TreeNode) -> bool:
        """Return whether a node, or one below it, may take more than one tick."""
        found = self._slow.get(id(node))
        if found is None:
            below = node.included.root if node.included is not None else None
            within = [*node.children, below] if below is not None else node.children
            slow = node.kind.begun or node.kind.slow
            busy = slow in node.values if isinstance(slow, str) else slow
            found = busy or any(self.takes_time(each) for each in within)
            self._slow[id(node)] = found
        return found

    # BT323

    def constant(self, condition: Computed) -> None:
        """Report a condition that reads nothing."""
        if not condition.expression.variables:
            text = f"{condition.expression.text.strip()} never changes"
            self._report("BT323", span_of(condition.node), text)

    # BT312

    def _taken(self, node: TreeNode, around: Mapping[str, TreeNode]) -> None:
        document = self.document
        given: dict[str, TreeNode | Declared] = {**document.inputs, **document.topics, **around}
        for write in self.checker.writes.get(id(node), ()):
            other = given.get(write.name)
            if other is not None:
                self._report(
                    "BT312", span_of(node.written.get(write.under, node.key)),
                    f"${write.name} already stands for something else here",
                    related=Related(other.place, "for this"),
                    hint="as: another name",
                )  # fmt: skip

    # BT308 to BT311

    def _unused(self) -> None:
        checker, document, doubts = self.checker, self.document, self.doubts
        reads = itertools.chain.from_iterable(checker.reads.values())
        read = {name for one in reads for name in one.expression.variables}
        read |= inputs_in_names(document)
        written = {write.name for writes in checker.writes.values() for write in writes}
        if not doubts.unknown_variable:
            self._unread(read, written)
        for name in self._own(document.actions):
            if name not in self._used and not doubts.unknown_action and not doubts.mentions(name):
                key = document.actions[name].key
                self._report("BT309", span_of(key), f"no node uses the action {name!r}")
        for name in self._own(document.kinds):
            if name not in self._used and not doubts.unknown_action and not doubts.mentions(name):
                key = document.kinds[name].key
                self._report("BT309", span_of(key), f"no node is of the kind {name!r}")
        for name, declared in document.outputs.items():
            given = name in written or name in document.inputs
            if not given and not doubts.unknown_action and not doubts.mentions(name):
                text = f"nothing writes the output {name!r}"
                self._report("BT311", span_of(declared.key), text)

    def _unread(self, read: set[str], written: set[str]) -> None:
        document, doubts = self.document, self.doubts
        for name, declared in document.inputs.items():
            if name not in read and name not in document.outputs and not doubts.mentions(name):
                self._report("BT308", span_of(declared.key), f"nothing reads the input {name!r}")
        for name in self._own(document.topics):
            if name not in read and not doubts.mentions(name):
                key = document.topics[name].key
                self._report("BT309", span_of(key), f"nothing reads the topic {name!r}")
        known = read | set(document.outputs) | set(document.inputs) | set(document.topics)
        for writes in self.checker.writes.values() if written - known else ():
            unread = [
                one for one in writes if one.name not in known and one.node.kind.group is Group.LEAF
            ]
            if not unread:
                continue
            node = unread[0].node
            tables = [node.written.get(key) for key in ("set", *SAVES)]
            pairs = (pair for one in tables if isinstance(one, YamlMapping) for pair in one.pairs)
            keys = {key.text: key for key, _ in pairs}
            for name in (one.name for one in unread if not doubts.mentions(one.name)):
                known.add(name)
                self._report("BT310", span_of(keys.get(name, node.key)), f"nothing reads ${name}")

    def _own(self, table: dict[str, Declared]) -> Iterator[str]:
        return (name for name, declared in table.items() if declared.source is self.source)


def _can(can: Can, end: End) -> bool:
    return can.fail if end is End.FAILURE else can.succeed


def _bounds(settings: Mapping[str, object]) -> bool:
    """Return whether settings give the result a deadline, or say that there is none."""
    timeout = settings.get("timeout", {})
    return not isinstance(timeout, dict) or "result" in timeout
