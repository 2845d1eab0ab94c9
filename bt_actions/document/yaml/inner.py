"""Where the characters of a scalar's text are written, so that a part of it can be pointed at.

Decodes what was written once more and compares it with libyaml's text: where the two differ, the
whole scalar is the answer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from bt_actions.document.findings import Span
from bt_actions.document.yaml.comments import block_header
from bt_actions.document.yaml.nodes import Scalar, span_of
from bt_actions.document.yaml.source import Char, Source

_ESCAPE = re.compile(
    r"\\(?:u([Dd][89ABab]..)\\u([Dd][C-Fc-f]..)"
    r"|x([0-9A-Fa-f]{2})|u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|(.))"
)
_SHORT = {'"': '"', "\\": "\\", "/": "/", " ": " ", "n": "\n", "t": "\t", "r": "\r", "0": "\0"}


def inner_span(node: Scalar, source: Source, start: int, end: int) -> Span:
    """The range of a part of a scalar's text; the whole scalar where that cannot be told."""
    chars = _decoded(node, source)
    if not chars:
        return span_of(node)
    if start >= len(chars):  # what is missing would stand behind it
        _, line, column = chars[-1]
        return Span(line, column + 1, line, column + 2)
    last = min(max(end, start + 1), len(chars)) - 1
    _, line, column = chars[start]
    _, end_line, end_column = chars[last]
    behind = chars[last + 1] if last + 1 < len(chars) else None
    width = behind[2] - end_column if behind is not None and behind[1] == end_line else 1
    return Span(line, column, end_line, end_column + max(width, 1))


def _decoded(node: Scalar, source: Source) -> list[Char]:
    """The characters of a text as they are written, or none where that cannot be told."""
    if source.decoded is None or source.decoded[0] is not node:
        chars = _written(node, source)
        text = "".join(char for char, _, _ in chars)
        same = text.rstrip("\n ") == node.text.rstrip("\n ")
        source.decoded = (node, chars if same else [])
    return source.decoded[1]


def _written(node: Scalar, source: Source) -> list[Char]:
    """The characters of a text as they are written; wrong, or none, for forms not known here."""
    lines = range(node.line, node.end_line + (node.end_column > 1))
    written = [(number, source.line(number) or "") for number in lines]
    header = block_header(node, source)
    if header:
        return list(_block(written[1:], folded=header[0] == ">"))
    first, text = written[0]
    if node.plain or len(written) > 1:
        if not node.plain:
            return []
        return list(_folded(written, node.column, node.end_column))
    quote = text[node.column - 1 : node.column]
    inside = text[node.column : node.end_column - 2]
    if quote == "'":
        return list(_single(inside, first, node.column + 1))
    return list(_double(inside, first, node.column + 1)) if quote == '"' else []


def _folded(written: list[tuple[int, str]], column: int, end_column: int) -> Iterator[Char]:
    """A plain text; its line breaks are spaces."""
    for at, (number, line) in enumerate(written):
        begin = column - 1 if at == 0 else len(line) - len(line.lstrip())
        stop = end_column - 1 if at == len(written) - 1 else len(line.rstrip())
        if at:
            yield " ", number, begin + 1
        for place in range(begin, min(stop, len(line))):  # a value of --set has no line
            yield line[place], number, place + 1


def _block(written: list[tuple[int, str]], *, folded: bool) -> Iterator[Char]:
    """A block text, with the indentation of its first line."""
    first = next((line for _, line in written if line.strip()), "")
    indent = len(first) - len(first.lstrip(" "))
    for number, line in written:
        for place in range(indent, len(line)):
            yield line[place], number, place + 1
        yield " " if folded else "\n", number, max(len(line), indent) + 1


def _single(inside: str, line: int, column: int) -> Iterator[Char]:
    at = 0
    while at < len(inside):
        yield inside[at], line, column + at
        at += 2 if inside.startswith("''", at) else 1


def _double(inside: str, line: int, column: int) -> Iterator[Char]:
    at = 0
    while at < len(inside):
        match = _ESCAPE.match(inside, at)
        if match is None:
            yield inside[at], line, column + at
            at += 1
            continue
        if match[1]:
            char = bytes.fromhex(match[1] + match[2]).decode("utf-16-be")
        else:
            code = match[3] or match[4] or match[5]
            char = chr(int(code, 16)) if code else _SHORT.get(match[6], "\0")
        yield char, line, column + at
        at = match.end()
