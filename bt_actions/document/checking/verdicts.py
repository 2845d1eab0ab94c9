"""How a node can end, and how long it may take, as far as that can be read off the document."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.tree import Document, TreeNode, settings_of


class Can(NamedTuple):
    """Whether a node can succeed, and whether it can fail."""

    succeed: bool
    fail: bool


_EITHER = Can(True, True)
BEGUN = frozenset({"service", "wait", "wait_for_message"})
"""Kinds that take time whenever they are begun, as actions do."""
_OPEN = frozenset({"action", "run_tree", "check", "python", "service", "wait_for_message"})
"""Kinds that may end either way, whatever they hold."""
_FIXED = {"success": Can(True, False), "failure": Can(False, True), "running": Can(False, False)}


class Verdicts:
    """Answers for the nodes of a document; each is worked out once.

    With `at_once` they are about a tick in which a node begins and ends, and nothing in it fails
    because it cannot be computed.
    """

    def __init__(self, *, at_once: bool = False) -> None:
        self._at_once = at_once
        self._known: dict[int, Can] = {}
        self._budgets: dict[int, float] = {}

    def of(self, node: TreeNode) -> Can:
        """How a node can end."""
        kind = node.kind.name
        if kind in _OPEN and not self._at_once:
            return _EITHER
        found = self._known.get(id(node))
        if found is None:
            found = self._known[id(node)] = self._work_out(kind, node)
        return found

    def _work_out(self, kind: str, node: TreeNode) -> Can:
        if kind in _FIXED:
            return _FIXED[kind]
        if self._at_once and (node.is_action or kind in BEGUN):
            return Can(False, False)
        if self._at_once and kind in ("log", "set", "publish", "wait_until"):
            return Can(True, False)
        if kind == "log":
            return Can(True, False)
        if kind == "wait":
            return Can(True, bool(computed_in(node.values.get(kind))))
        if kind in ("set", "publish"):
            data = node.values.get("set" if kind == "set" else "message")
            waits = node.values.get("timeout") is not None
            return Can(True, waits or bool(computed_in(data)))
        if kind == "subtree":
            return self._subtree(node)
        if not node.children:
            return _EITHER
        ends = [self.of(child) for child in node.children]
        if kind in ("sequence", "fallback"):
            return _in_turn(ends, kind)
        if kind == "parallel":
            enough = all if node.values.get("policy", "all") == "all" else any
            return Can(enough(end.succeed for end in ends), any(end.fail for end in ends))
        if self._at_once and kind in ("retry", "repeat", "for_each"):
            once = _in_one_tick(kind, node)  # each round or try after the first is a tick later
            return Can(
                ends[0].succeed and (once or kind == "retry"),
                ends[0].fail and (once or kind != "retry"),
            )
        return self._decorated(kind, ends[0], node)

    def _subtree(self, node: TreeNode) -> Can:
        if node.included is None or node.included.root is None:
            return _EITHER
        inner = self.of(node.included.root)
        refused = bool(computed_in(node.values.get("with")))
        return Can(inner.succeed, inner.fail or (refused and not self._at_once))

    def _decorated(self, kind: str, inner: Can, node: TreeNode) -> Can:
        ends = inner.succeed or inner.fail
        limit = node.values.get("times" if kind == "repeat" else "attempts")
        known = isinstance(limit, int)  # a limit that is computed may be none, and may be zero
        return {
            "invert": Can(inner.fail, inner.succeed),
            "force_success": Can(ends, False),
            "force_failure": Can(False, ends),
            "retry": Can(inner.succeed, limit is not None and (inner.fail or not known)),
            "repeat": Can(
                limit is not None and (inner.succeed or limit == 0 or not known),
                (inner.fail and limit != 0) or not (known or limit is None),
            ),
            "timeout": Can(inner.succeed, inner.fail or not self._at_once),
            "while": Can(inner.succeed, True),
            "run_once": _EITHER if self._at_once else inner,
        }.get(kind, _EITHER)

    def budget(self, node: TreeNode, document: Document) -> float:
        """The seconds that a node's deadlines and pauses add up to; what has none counts nothing.

        `document` is the one that the node stands in.
        """
        found = self._budgets.get(id(node))
        if found is None:
            found = self._budgets[id(node)] = self._add_up(node, document)
        return found

    def _add_up(self, node: TreeNode, document: Document) -> float:
        kind = node.kind.name
        if node.is_action:
            settings = settings_of(node, document)
            return _tries(_deadline(settings, "result"), settings.get("retry"))
        if kind == "service":
            return _tries(_deadline(node.values, "response"), node.values.get("retry"))
        if kind in ("wait", "wait_until", "wait_for_message", "publish"):
            limit = node.values.get("wait" if kind == "wait" else "timeout")
            return limit if isinstance(limit, float) else 0.0
        if node.included is not None and node.included.root is not None:
            return self.budget(node.included.root, node.included)
        inner = [self.budget(child, document) for child in node.children]
        if not inner:
            return 0.0
        if kind in ("sequence", "fallback"):
            return sum(inner)
        after = node.values.get("after")
        if kind == "timeout" and isinstance(after, float):
            return min(after, inner[0])
        if kind == "retry":
            return _tries(inner[0], node.values)
        return inner[0] * _rounds(kind, node) if len(inner) == 1 else max(inner)


def _in_turn(ends: list[Can], kind: str) -> Can:
    """How children end that are ticked one after the other, until one ends them all."""
    onward = 0 if kind == "sequence" else 1
    passes, stops = True, False
    for end in ends:
        stops = stops or end[1 - onward]
        passes = end[onward]
        if not passes:
            break
    return Can(passes, stops) if kind == "sequence" else Can(stops, passes)


def _deadline(settings: Mapping[str, object], name: str) -> float:
    timeout = settings.get("timeout")
    limit = timeout.get(name) if isinstance(timeout, dict) else None
    return limit if isinstance(limit, float) else 0.0


def _in_one_tick(kind: str, node: TreeNode) -> bool:
    """Whether there is no second try, round or item."""
    items = node.values.get("in")
    if kind == "for_each":
        return isinstance(items, list) and len(items) < 2
    return node.values.get("attempts" if kind == "retry" else "times") in (0, 1)


def _rounds(kind: str, node: TreeNode) -> float:
    """How often a node has its child run, where the document says so."""
    times, items = node.values.get("times"), node.values.get("in")
    if kind == "repeat" and isinstance(times, int):
        return _float(times)
    return float(len(items)) if kind == "for_each" and isinstance(items, list) else 1.0


def _tries(each: float, retry: object) -> float:
    """The seconds of all tries and the pauses between; nothing where a try has no limit."""
    if not isinstance(retry, dict) or each == 0.0:
        return each
    attempts = retry.get("attempts", 1)
    if not isinstance(attempts, int):
        return each
    pause: float = retry.get("backoff", 0.0)
    factor: float = retry.get("factor", 2.0)
    longest: float = retry.get("max_backoff", 60.0)
    total, left = each * _float(attempts), attempts - 1
    if not pause:
        return total
    while left > 0 and pause < longest and factor > 1.001:
        total, pause, left = total + pause, pause * factor, left - 1
    return total + _float(left) * min(pause, longest)


def _float(count: int) -> float:
    """A whole number as one that no arithmetic overflows with."""
    return float(min(count, 10**12))
