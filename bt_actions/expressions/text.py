"""The text of an expression, made readable to Python's parser without losing any place.

No ROS here, and nothing is evaluated. Python knows neither `$name` nor the index in `$name.0`, and
takes no word of its own for a field (`$leg.from`).
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Sequence
from typing import NamedTuple

_SIMPLE = re.compile(r"(?:[A-Za-z0-9_ .,+\-*/%<>=()\[\]]|\$(?=[A-Za-z]))*")
"""Texts of which each character keeps its place: nearly all."""
_INDEX = re.compile(r"[A-Za-z_)\]]\w*\.[0-9]")
_RUN_ON = re.compile(
    r"""'[^']*'|"[^"]*"|(?<![\w.$])(?:0[xX][0-9a-fA-F]+?|[\d.][\d._]*(?:[eE][+-]?\d+)?[jJ]?)"""
    r"(and|else|for|if|in|is|not|or)\b"
)
"""A number and a word without a space between: Python reads it so far, and warns."""
_FIELD = re.compile(rf"""'[^']*'|"[^"]*"|\.({"|".join(keyword.kwlist)})\b""")
_FOREIGN = re.compile(
    r"""'[^']*'|"[^"]*"|(?P<equal>[!=]==)|(?<![\w.$])(?P<word>(?!and|or|not)(?i:and|or|not))\b"""
)
"""What other languages write, and Python cannot read."""
_NEGATED = re.compile(r"!\s*(\$?[\w.$\[\]]+)")
_BAD_WORDS = {
    # of other languages, and of chats and word processors
    "&&": "write 'and'",
    "||": "write 'or'",
    "&": "write 'and'",
    "|": "write 'or'",
    "<>": "write '!='",
    "?": "there is no conditional expression",
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
    """The text as Python can read it, and where each of its characters came from."""

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
    if _SIMPLE.fullmatch(text) and "<>" not in text and not _INDEX.search(text):
        variables_at = [at for at, char in enumerate(text) if char == "$"] if "$" in text else []
        return Source(text.replace("$", "_"), range(len(text) + 1), frozenset(variables_at))
    out: list[str] = []
    origin: list[int] = []
    variables: set[int] = set()

    def put(piece: str, at: int) -> None:
        for char in piece:
            out.append(char)
            origin.append(at)

    index, size = 0, len(text)
    while index < size:
        char = text[index]
        if char in "'\"":
            end = _end_of_string(text, index)
            for at in range(index, end):
                put(_ascii(text[at]), at)
            index = end
        elif char == "$":
            if not (text[index + 1 : index + 2].isalpha() and text[index + 1].isascii()):
                raise ExpressionError("a dollar sign begins a name: write $name", index)
            variables.add(len(out))
            put("_", index)
            index += 1
        elif char == "." and text[index + 1 : index + 2].isdigit() and _follows_value(text, index):
            end = index + 1
            while end < size and text[end].isdigit():
                end += 1
            put("[", index)
            for at in range(index + 1, end):
                put(text[at], at)
            put("]", end - 1)
            index = end
        elif char in "\n\r\t":
            put(" ", index)
            index += 1
        else:
            _refuse_foreign(text, index)
            put(char, index)
            index += 1
    origin.append(size)
    return Source("".join(out), origin, frozenset(variables))


def foreign_in(text: str) -> ExpressionError | None:
    """Return the error for a word of another language, outside of quotes; or None."""
    for found in _FOREIGN.finditer(text):
        if found["equal"]:
            return ExpressionError(f"{found[0]!r}: write '{found[0][:2]}'", *found.span())
        if found["word"]:
            return ExpressionError(f"write {found[0].lower()!r}", *found.span())
    return None


def _end_of_string(text: str, start: int) -> int:
    index = start + 1
    while index < len(text) and text[index] != text[start]:
        if text[index] in "\\\n\r":
            raise ExpressionError("a text here holds no backslash and no line break", index)
        index += 1
    if index == len(text):
        raise ExpressionError("this text has no closing quote", start, len(text))
    return index + 1


def _ascii(char: str) -> str:
    """Escape a character of a text that UTF-8 needs several bytes for: Python counts bytes."""
    return char if char.isascii() else f"\\U{ord(char):08x}"


def _follows_value(text: str, index: int) -> bool:
    """Return whether the dot at `index` stands behind a name or an index, not inside a number."""
    start = index
    while start > 0 and (text[start - 1].isalnum() or text[start - 1] == "_"):
        start -= 1
    word = text[start:index]
    if not word:
        return index > 0 and text[index - 1] in ")]"
    if not word[0].isdigit():
        return True
    return start > 0 and text[start - 1] == "." and _follows_value(text, start - 1)


def _refuse_foreign(text: str, index: int) -> None:
    char = text[index]
    if char == "!" and text[index + 1 : index + 2] == "=":
        return
    if char == "!":
        negated = _NEGATED.match(text, index)
        wanted = f"not {negated[1]}" if negated else "not"
        raise ExpressionError(f"'!': write '{wanted}'", index)
    for word in (text[index : index + 2], char):
        if word in _BAD_WORDS:
            raise ExpressionError(f"{word!r}: {_BAD_WORDS[word]}", index, index + len(word))
    if not char.isascii():
        raise ExpressionError(f"{char!r} has no place in an expression", index)
