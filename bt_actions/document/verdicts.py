"""How a node can end, and how long it may take, as far as that can be read off the document."""

from __future__ import annotations

from typing import NamedTuple

from bt_actions.document.build_names import settings_of
from bt_actions.document.tree import Document, TreeNode
from bt_actions.document.values import computed_in

__all__ = ["Can", "Verdicts", "budget"]


class Can(NamedTuple):
    """Whether a node can succeed, and whether it can fail."""

    succeed: bool
    fail: bool


_EITHER = Can(True, True)
_FIXED = {"success": Can(True, False), "failure": Can(False, True), "running": Can(False, False)}


class Verdicts:
    """Answers for the nodes of a document; each is worked out once."""

    def __init__(self) -> None:
        self._known: dict[int, Can] = {}

    def of(self, node: TreeNode) -> Can:
        """How a node can end."""
        found = self._known.get(id(node))
        if found is None:
            found = self._known[id(node)] = self._work_out(node)
        return found

    def _work_out(self, node: TreeNode) -> Can:
        kind = node.kind.name if node.kind is not None else ""
        if kind in _FIXED:
            return _FIXED[kind]
        if kind in ("log", "wait"):
            return Can(True, any(True for _ in computed_in(node.values.get(kind))))
        if kind == "subtree":
            return self._subtree(node)
        if not node.children:
            return _EITHER
        ends = [self.of(child) for child in node.children]
        if kind == "sequence":
            return Can(all(end.succeed for end in ends), any(end.fail for end in ends))
        if kind == "fallback":
            return Can(any(end.succeed for end in ends), all(end.fail for end in ends))
        return self._decorated(kind, ends[0], node)

    def _subtree(self, node: TreeNode) -> Can:
        if node.included is None or node.included.root is None:
            return _EITHER
        inner = self.of(node.included.root)
        refused = any(True for _ in computed_in(node.values.get("with")))
        return Can(inner.succeed, inner.fail or refused)

    @staticmethod
    def _decorated(kind: str, inner: Can, node: TreeNode) -> Can:
        ends = inner.succeed or inner.fail
        limited = "attempts" in node.values or "times" in node.values
        return {
            "invert": Can(inner.fail, inner.succeed),
            "force_success": Can(ends, False),
            "force_failure": Can(False, ends),
            "retry": inner if limited else Can(inner.succeed, False),
            "repeat": inner if limited else Can(False, inner.fail),
            "timeout": Can(inner.succeed, True),
            "while": Can(inner.succeed, True),
            "run_once": inner,
        }.get(kind, _EITHER)


def budget(node: TreeNode, document: Document) -> float:
    """The seconds that a node's deadlines and pauses add up to; what has none counts nothing."""
    kind = node.kind.name if node.kind is not None else ""
    if node.alias is not None or kind == "action":
        settings = settings_of(node, document)
        timeout, retry = settings.get("timeout"), settings.get("retry")
        result = timeout.get("result") if isinstance(timeout, dict) else None
        attempts = retry.get("attempts", 1) if isinstance(retry, dict) else 1
        known = isinstance(result, float) and isinstance(attempts, int)
        return result * attempts if known else 0.0  # type: ignore[operator]
    if kind == "wait":
        wait = node.values.get("wait")
        return wait if isinstance(wait, float) else 0.0
    if node.included is not None and node.included.root is not None:
        return budget(node.included.root, node.included)
    inner = [budget(child, document) for child in node.children]
    if not inner:
        return 0.0
    if kind == "sequence":
        return sum(inner)
    after = node.values.get("after")
    if kind == "timeout" and isinstance(after, float):
        return min(after, inner[0])
    times = node.values.get("attempts" if kind == "retry" else "times")
    if kind in ("retry", "repeat") and isinstance(times, int):
        return inner[0] * times
    return max(inner)
