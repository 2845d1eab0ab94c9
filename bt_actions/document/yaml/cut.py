"""A plain text that a '#' cut short: ``Part #3`` is the text ``Part`` and a comment.

Where a space follows the '#' a comment was meant; nobody can tell more.
"""

from __future__ import annotations

from bt_actions.document.findings import Span
from bt_actions.document.yaml.nodes import Scalar
from bt_actions.document.yaml.source import Source

__all__ = ["cut_hint", "warn_cut"]


def warn_cut(node: Scalar, source: Source, what: str) -> None:
    """Say so where a comment begins without a space behind its '#'; `what` was cut."""
    rest = _behind(node, source) if source.commented else ""
    if not rest:
        return
    mark = rest.lstrip()
    if len(mark) < 2 or mark[0] != "#" or mark[1] in " \t#!":
        return
    line, at = node.end_line, node.end_column + len(rest) - len(mark)
    source.report(
        "BT116", Span(line, at, line, at + len(mark.rstrip())),
        f"{mark.rstrip()!r} is read as a comment: the {what} is {node.text!r}",
        hint=f"put the {what} in quotes, or a space behind the '#'",
    )  # fmt: skip


def cut_hint(node: Scalar, source: Source) -> str | None:
    """What to add to an error in a text that a comment follows."""
    if _behind(node, source).lstrip().startswith("#"):
        return "the '#' after it begins a comment: put the text in quotes"
    return None


def _behind(node: Scalar, source: Source) -> str:
    """What stands behind a plain text on its line, if a '#' is on that."""
    if not node.plain or node.end_line not in source.commented:
        return ""
    return (source.line(node.end_line) or "")[node.end_column - 1 :]
