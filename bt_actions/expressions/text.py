"""The text of an expression, made readable to Python's parser without losing any place.

No ROS here, and nothing is evaluated. Python knows neither `$name` nor the index in `$name.0`, and
takes no word of its own for a field (`$leg.from`).
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Sequence
from typing import NamedTuple

_RUN_ON = re.compile(
    r"""'[^']*'|"[^"]*"|(?<![\w.$])(?:0[xX][0-9a-fA-F]+?|[\d.][\d._]*(?:[eE][+-]?\d+)?[jJ]?)"""
    r"(and|else|for|if|in|is|not|or)\b"
)
"""A number and a word without a space between: Python reads both apart, and warns."""
_FIELD = re.compile(rf"""'[^']*'|"[^"]*"|\.({"|".join(keyword.kwlist)})\b""")
_FOREIGN = re.compile(
    r"""'[^']*'|"[^"]*"|(?P<equal>[!=]==)|(?<![\w.$])(?P<word>(?!and|or|not)(?i:and|or|not))\b"""
)
"""Operators of other languages, which Python cannot read."""
_NEGATED = re.compile(r"!\s*(\$?[\w.$\[\]]+)")
_BAD_WORDS = {
    # of other languages, and of chats and word processors
    "&&": "write 'and'",
    "||": "write 'or'",
    "&": "write 'and'",
    "|": "write 'or'",
    "<>": "write '!='",
    "?": "write 'A if CONDITION else B'",
    ";": "one expression only",
    "#": "a comment has no place in an expression",
    "\\": "a backslash has no place here",
    "`": "a backtick has no place here",
    **dict.fromkeys("“”„«»‘’‚", "write ' around a text"),
    **dict.fromkeys("‐‑–—−", "write '-'"),
    **dict.fromkeys("×·", "write '*'"),
    "÷": "write '/'",
    "≥": "write '>='",
    "≤": "write '<='",
    "≠": "write '!='",
    "∧": "write 'and'",
    "∨": "write 'or'",
    "¬": "write 'not'",
    "…": "write out what it stands for",
}
_BREAK = re.compile(r"[\\\n\r]")
_PIECE = re.compile(
    r"""(?P<text>'[^'\\\n\r]*'|"[^"\\\n\r]*")|(?P<space>[\n\r\t])|(?P<variable>\$(?=[A-Za-z]))"""
    r"""|(?P<number>(?:(?<![\w.])\d|(?<![\w.)\]])\.\d)[\w.]*)|(?<=[\w)\]])\.(?P<index>\d+)"""
    rf"""|(?P<wrong>['"$]|!(?!=)|{"|".join(map(re.escape, _BAD_WORDS))}|[^\x00-\x7F])""",
    re.ASCII,
)
"""Pieces that Python reads otherwise, or not at all, and numbers, whose dots are no indices."""


class ExpressionError(ValueError):
    """An expression that cannot be read, or has no value; `column` and `end_column` count from 0.

    Columns are offsets into the expression's own text.
    """

    def __init__(self, message: str, column: int = 0, end_column: int | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.column = column
        self.end_column = max(column + 1, end_column or 0)


class Source(NamedTuple):
    """A text that Python can read, and the origin of each of its characters."""

    text: str
    origin: Sequence[int]
    variables: frozenset[int]  # offsets (in the translated text) of names written with a dollar


def translate(text: str) -> Source:
    """Make `$name` `_name`, and the `.0` of `$name.0` `[0]`, keeping the places.

    The first letter of a field that is a word of Python's becomes `_`.
    """
    for match in _RUN_ON.finditer(text):
        if match[1]:
            raise ExpressionError(f"a space is missing before {match[1]!r}", *match.span(1))
    if "." in text:
        text = _FIELD.sub(lambda found: f"._{found[1][1:]}" if found[1] else found[0], text)
    out: list[str] = []
    origin: list[int] = []
    variables: set[int] = set()
    done = len(text) - len(text.lstrip())  # Python would take spaces before it for a block
    for piece in _PIECE.finditer(text, done):
        start, end = piece.span()
        out.append(text[done:start])
        origin.extend(range(done, start))
        done = end
        made, places = piece[0], [*range(start, end)]
        match piece.lastgroup:
            case "text" if not made.isascii():  # Python counts columns in UTF-8 bytes
                escaped = [each if each.isascii() else f"\\U{ord(each):08x}" for each in made]
                made = "".join(escaped)
                places = [at for at, each in zip(places, escaped, strict=True) for _ in each]
            case "variable":
                variables.add(len(origin))
                made = "_"
            case "index":
                made, places = f"[{piece['index']}]", [*places, end - 1]
            case "space":
                made = " "
            case "wrong":
                raise _refusal(text, *piece.span())
        out.append(made)
        origin.extend(places)
    out.append(text[done:])
    origin.extend(range(done, len(text) + 1))
    return Source("".join(out), origin, frozenset(variables))


def foreign_in(text: str) -> ExpressionError | None:
    """Return the error for a word of another language, outside of quotes; or None."""
    for found in _FOREIGN.finditer(text):
        if found["equal"]:
            return ExpressionError(f"{found[0]!r}: write '{found[0][:2]}'", *found.span())
        if found["word"]:
            return ExpressionError(f"write {found[0].lower()!r}", *found.span())
    return None


def _refusal(text: str, start: int, end: int) -> ExpressionError:
    wrong = text[start:end]
    if wrong in _BAD_WORDS:
        return ExpressionError(f"{wrong!r}: {_BAD_WORDS[wrong]}", start, end)
    if wrong in "'\"":
        if found := _BREAK.search(text, start):
            what = "a text here holds no backslash and no line break"
            return ExpressionError(what, found.start())
        return ExpressionError("this text has no closing quote", start, len(text))
    if wrong == "$":
        return ExpressionError("a dollar sign begins a name: write $name", start)
    if wrong == "!":
        negated = _NEGATED.match(text, start)
        return ExpressionError(f"'!': write '{f'not {negated[1]}' if negated else 'not'}'", start)
    return ExpressionError(f"{wrong!r} has no place in an expression", start)
