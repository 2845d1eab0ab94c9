"""Which column a line should begin in that lines up with nothing above it.

Goes by the lines alone, since what is no YAML has no nodes: each key and each dash above is open
until a line begins further to the left.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from bt_actions.document.yaml.source import Source

_DASH = re.compile(r"-( +|$)")
_KEY = re.compile(r"""["']?([\w<][^:'"]{0,40})["']?\s*:(?:\s|$)""")


class _Open(NamedTuple):
    """A key, or the dash of an item (without a name), that a line may line up with."""

    column: int
    line: int
    name: str = ""


def column_hint(source: Source, line: int) -> str | None:
    """Say where a line should begin: ``begin it in column 7, as the item in line 5 does``."""
    text = source.line(line) or ""
    column = _indent(text) + 1
    is_item = _DASH.match(text.lstrip(" ")) is not None
    opened = _opened_above(source, line)
    fitting = [one for one in opened if is_item != bool(one.name) and one.column != column]
    if not fitting:
        return None
    nearest = min(fitting, key=lambda one: (abs(one.column - column), -one.column))
    what = repr(nearest.name) if nearest.name else "the item"
    hint = f"begin it in column {nearest.column}, as {what} in line {nearest.line} does"
    if not is_item and any(one.column == column and not one.name for one in opened):
        return f"{hint}, or with '- ' for another item"
    return hint


def _opened_above(source: Source, line: int) -> list[_Open]:
    """What is open where a line begins, from the outside to the inside."""
    opened: list[_Open] = []
    for number, text in enumerate(source.lines[: line - 1], 1):
        at = _indent(text)
        if text[at : at + 1] in ("", "#"):
            continue
        dash = _DASH.match(text, at)
        while opened and opened[-1].column > at + bool(dash and opened[-1].name):
            opened.pop()  # but for the key of a list that is indented as its key is
        while dash := _DASH.match(text, at):
            opened.append(_Open(at + 1, number))
            at = dash.end()
        if key := _KEY.match(text, at):
            opened.append(_Open(at + 1, number, key[1]))
    return opened


def _indent(text: str) -> int:
    return len(text) - len(text.lstrip(" "))
