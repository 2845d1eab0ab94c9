"""The checks of names and types, in their order: what the form alone cannot tell."""

from __future__ import annotations

from bt_actions.document.checking.actions import check_actions, check_defaults, check_together
from bt_actions.document.checking.checker import Checker
from bt_actions.document.checking.declarations import check_declarations
from bt_actions.document.checking.kinds import CHECKS
from bt_actions.document.checking.names import check_names
from bt_actions.document.reading.tree import TreeNode

__all__ = ["check_document"]


def check_document(checker: Checker) -> None:
    """Report everything that is wrong with names and types to the documents' own sources."""
    check_declarations(checker)
    checker.collect_writes()
    check_actions(checker)
    for node in checker.document.nodes():
        checker.reader = node
        _check_node(checker, node)
    check_defaults(checker)
    check_names(checker)


def _check_node(checker: Checker, node: TreeNode) -> None:
    if node.kind.name in CHECKS:
        CHECKS[node.kind.name](checker, node)
    if node.alias is not None:
        check_together(checker, node)
