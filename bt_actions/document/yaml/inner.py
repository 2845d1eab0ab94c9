"""Where the characters of a scalar's text are written, so that a part of it can be pointed at.

Looks for libyaml's text in what was written: where it is not found, the whole scalar is the answer.
"""

from __future__ import annotations

import re

from bt_actions.document.findings import Span
from bt_actions.document.yaml.comments import block_header, content_of
from bt_actions.document.yaml.nodes import Scalar, span_of
from bt_actions.document.yaml.source import Char, Source

__all__ = ["inner_span"]

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
        source.decoded = node, _found(node, source)
    return source.decoded[1]


def _found(node: Scalar, source: Source) -> list[Char]:
    """The characters of a text, looked for one after the other in what was written.

    What is passed over is indentation, the second of two quotes, and whatever else says nothing. A
    line break may stand for a space.
    """
    found: list[Char] = []
    content = content_of(node, source)
    line, at = node.line, len(source.line(node.line) or "") - len(content)
    if block_header(node, source):
        line, at = line + 1, 0
    elif content[:1] in ("'", '"'):
        at += 1
    escapes = content.startswith('"')
    for char in node.text:
        while line <= node.end_line:
            written = source.line(line) or ""
            escape = _ESCAPE.match(written, at) if escapes else None
            there = _said(escape) if escape else (written[at : at + 1] or "\n")
            found.append((char, line, at + 1))
            at = escape.end() if escape else at + 1
            if at > len(written):
                line, at = line + 1, 0
            if there == char or (there == "\n" and char == " "):
                break
            found.pop()
        else:
            return [] if node.text[len(found) :].strip("\n ") else found
    return found


def _said(escape: re.Match[str]) -> str:
    if escape[1]:
        return bytes.fromhex(escape[1] + escape[2]).decode("utf-16-be")
    code = escape[3] or escape[4] or escape[5]
    return chr(int(code, 16)) if code else _SHORT.get(escape[6], "")
