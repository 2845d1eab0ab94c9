"""Texts that YAML reads in another way than their author is likely to mean.

``Part #3`` is the text ``Part`` and a comment. With a space after the '#' the author may well mean
a comment, and gets no warning. In ``“map”`` the quotes are a part of the text. ``{x}`` is a mapping
of x to nothing, where an author means a variable or a word. ``5000`` are seconds.
"""

from __future__ import annotations

from bt_actions.document.findings import Span
from bt_actions.document.yaml.nodes import Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source, unquoted
from bt_actions.utilities.units import TURN, spoken_duration

_LONGEST = 40
"""Characters of a number in a message."""
_LONG = 500.0
"""Seconds that an author would rather give in minutes."""


def warn_cut(node: Scalar, source: Source, what: str) -> None:
    """Warn of a comment that begins without a space behind its '#'; `what` was cut."""
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
    """Warn of a text in typographic quotes."""
    inside = unquoted(node.text) if node.plain else None
    if inside is not None:
        source.report(
            "BT322", span_of(node), f"the quotes are a part of the text: {node.text}",
            hint=f"write \"{inside}\", or '{node.text}' where they are meant",
        )  # fmt: skip


def cut_hint(node: Scalar, source: Source) -> str | None:
    """Return what to add to an error in a text that a comment follows."""
    if _behind(node, source).lstrip().startswith("#"):
        return "the '#' after it begins a comment: put the text in quotes"
    return None


def _behind(node: Scalar, source: Source) -> str:
    """Return the rest of the line behind a plain text, where that rest holds a '#'."""
    if not node.plain or node.end_line not in source.commented:
        return ""
    return (source.line(node.end_line) or "")[node.end_column - 1 :]


def report_braces(node: Node, source: Source) -> bool:
    """Report `{x}` where no mapping can stand, and return whether it stands there."""
    if not isinstance(node, Mapping) or not node.flow or len(node.pairs) != 1:
        return False
    key, value = node.pairs[0]
    if not isinstance(value, Scalar) or value.text or not value.plain:
        return False
    hint = f"leave the braces away, or write ${key.text} for a variable"
    source.report("BT117", span_of(node), f"{{{key.text}}} is read as a mapping", hint=hint)
    return True


def warn_bare_duration(node: Scalar, seconds: float, source: Source) -> None:
    """Warn of a duration without a unit, so long that milliseconds are likely to be meant."""
    if abs(seconds) >= _LONG:
        said = "is {} s = " + spoken_duration(seconds)
        _warn_bare(node, source, "BT317", said, "for milliseconds write {0} ms, else {0} s")


def warn_bare_angle(node: Scalar, radians: float, source: Source) -> None:
    """Warn of an angle beyond a full turn: degrees are likely to be meant."""
    if abs(radians) > TURN:
        _warn_bare(
            node, source, "BT318", "is in radians", "for degrees write {0} deg, else {0} rad"
        )


def _warn_bare(node: Scalar, source: Source, code: str, said: str, hint: str) -> None:
    text = node.text.strip()
    if text[-1].isalpha():  # a unit
        return
    text = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    message = f"{text} without a unit {said.format(text)}"
    source.report(code, span_of(node), message, hint=hint.format(text))
