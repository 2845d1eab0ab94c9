"""A plain text that is not what it looks like: cut by a '#', or in quotes that YAML does not know.

``Part #3`` is the text ``Part`` and a comment; where a space follows the '#' a comment was meant,
nobody can tell more. In ``“map”`` the quotes are a part of the text.
"""

from __future__ import annotations

from bt_actions.document.findings import Span
from bt_actions.document.yaml.nodes import Scalar, span_of
from bt_actions.document.yaml.source import Source, unquoted


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


def warn_quotes(node: Scalar, source: Source) -> None:
    """Say so where a text is written in typographic quotes."""
    inside = unquoted(node.text) if node.plain else None
    if inside is not None:
        source.report(
            "BT322", span_of(node), f"the quotes are a part of the text: {node.text}",
            hint=f"write \"{inside}\", or '{node.text}' where they are meant",
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
