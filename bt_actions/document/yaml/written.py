"""Comments, and the places of a scalar's characters in the text.

libyaml tells neither. Both are found from composed scalars, so that they agree with libyaml: a '#'
outside of all scalars begins a comment, and the characters of a scalar are found one after the
other in the text. ``# bt: ignore[BT301] reason`` silences a warning: on the same line, or alone on
a line above.
"""

from __future__ import annotations

import re
from bisect import bisect
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from bt_actions.document.findings import Severity, Span
from bt_actions.document.findings.rules import RULES
from bt_actions.document.yaml.nodes import Node, Scalar, span_of, walk
from bt_actions.document.yaml.source import Char, Source
from bt_actions.utilities.suggest import did_you_mean

_LATER = (float("inf"), 0.0)
_PROPERTY = re.compile(r"[&!]\S*\s+")
_IGNORE = re.compile(r"(?:^|(?<=\s))#\s*bt:\s*ignore\b(?:\[([^\]]*)\])?")
_CODE = re.compile(r"[^\s,]+")
_ESCAPE = re.compile(
    r"\\(?:u([Dd][89ABab]..)\\u([Dd][C-Fc-f]..)"
    r"|x([0-9A-Fa-f]{2})|u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|(.))"
)
_SHORT = {'"': '"', "\\": "\\", "/": "/", " ": " ", "n": "\n", "t": "\t", "r": "\r", "0": "\0"}


class Comment(NamedTuple):
    """A comment, from its '#' on; `alone` without text before it. Line and column count from 1."""

    line: int
    column: int
    text: str
    alone: bool


def scalars_of(root: Node) -> Iterator[Scalar]:
    """Yield every scalar of a node, in the order of `walk`."""
    return (node for node in walk(root) if isinstance(node, Scalar))


def _content_of(scalar: Scalar, source: Source) -> str:
    """Return the text on the first line of a scalar, behind its anchor and its tag."""
    written = (source.line(scalar.line) or "")[scalar.column - 1 :]
    while (match := _PROPERTY.match(written)) is not None:
        written = written[match.end() :]
    return written


def block_header(scalar: Scalar, source: Source) -> str:
    """Return ``|``, ``>-`` and the like, where a scalar is a block; else ""."""
    written = "" if scalar.plain else _content_of(scalar, source)
    return written.split(" ")[0].split("\t")[0] if written[:1] in ("|", ">") else ""


def comments_of(source: Source, scalars: Iterable[Scalar]) -> Iterator[Comment]:
    """Yield the comments of a text, in its order, given all of its scalars."""
    lines = source.commented
    texts = sorted(
        _range(scalar, source)
        for scalar in scalars
        if not lines.isdisjoint(range(scalar.line, scalar.end_line + 1))
    )
    for number in sorted(lines):
        line = source.lines[number - 1]
        for at in (at for at, char in enumerate(line, 1) if char == "#"):
            before = bisect(texts, ((number, at), _LATER))
            if not before or texts[before - 1][1] <= (number, at):
                yield Comment(number, at, line[at - 1 :].rstrip(), not line[: at - 1].strip())
                break


def _range(scalar: Scalar, source: Source) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return begin and end of a scalar; behind the header of a block a comment may stand."""
    is_block = block_header(scalar, source) != ""
    begin = (scalar.line + 1, 0) if is_block else (scalar.line, scalar.column)
    return begin, (scalar.end_line, scalar.end_column)


def apply_ignores(source: Source, complete: Callable[[], bool]) -> None:
    """Take the silenced findings out of a source, and report wrong ignores.

    An ignore that names no rule, or an error, or silences nothing, is an error. `complete` returns
    whether all rules were tried: else no ignore is called useless.
    """
    if "ignore" not in source.text or source.root is None:
        return
    there = {(finding.code, finding.line) for finding in source.findings}
    silenced: set[tuple[str, int]] = set()
    useless: list[tuple[str, Span]] = []
    for comment, target in _targets(source):
        for code, span in _codes(source, comment):
            if not _can_be_silenced(source, code, span):
                continue
            if (code, target) in there and (code, target) not in silenced:
                silenced.add((code, target))
            else:
                useless.append((code, span))
    if silenced:
        source.findings[:] = [
            finding for finding in source.findings if (finding.code, finding.line) not in silenced
        ]
    for code, span in useless if complete() else ():
        source.report("BT120", span, f"there is no {code} here to silence")


def is_ignore(comment: Comment) -> bool:
    """Return whether a comment silences a rule."""
    return _IGNORE.search(comment.text) is not None


def _targets(source: Source) -> Iterator[tuple[Comment, int]]:
    """Yield the comments that hold an ignore, each with the number of the line it is about."""
    assert source.root is not None
    comments = list(comments_of(source, scalars_of(source.root)))
    ignores = [comment for comment in comments if is_ignore(comment)]
    if not ignores:
        return
    below = _lines_below(source, {comment.line for comment in comments if comment.alone})
    for comment in ignores:
        yield comment, below[comment.line] if comment.alone else comment.line


def _lines_below(source: Source, skipped: set[int]) -> list[int]:
    """Return for each line the next line with content; for the last such line itself."""
    found = list(range(len(source.lines) + 1))
    later = 0
    for number in range(len(source.lines), 0, -1):
        found[number] = later or number
        if number not in skipped and source.lines[number - 1].strip():
            later = number
    return found


def _codes(source: Source, comment: Comment) -> Iterator[tuple[str, Span]]:
    """Yield the rules that a comment names, with their places; report an ignore without a rule."""
    line, before = comment.line, comment.column - 1
    for match in _IGNORE.finditer(comment.text):
        if not (match[1] or "").strip():
            span = Span(line, before + match.start() + 1, line, before + match.end() + 1)
            hint = "# bt: ignore[BT301] why"
            source.report("BT119", span, "an ignore names the rules it silences", hint=hint)
            continue
        for code in _CODE.finditer(match[1]):
            start = before + match.start(1) + code.start() + 1
            yield code[0], Span(line, start, line, start + len(code[0]))


def _can_be_silenced(source: Source, code: str, span: Span) -> bool:
    rule = RULES.get(code)
    if rule is None:
        near = did_you_mean(code, RULES)
        source.report("BT119", span, f"there is no rule {code!r}{near}")
    elif rule.severity is Severity.ERROR:
        source.report("BT119", span, f"{code} is an error: it cannot be silenced")
    else:
        return True
    return False


def inner_span(node: Scalar, source: Source, start: int, end: int) -> Span:
    """Return the range of a part of a scalar's text; of the whole scalar where no part is found."""
    chars = _decoded(node, source)
    if not chars:
        return span_of(node)
    if start >= len(chars):  # a missing part would stand behind the text
        _, line, column = chars[-1]
        return Span(line, column + 1, line, column + 2)
    last = min(max(end, start + 1), len(chars)) - 1
    _, line, column = chars[start]
    _, end_line, end_column = chars[last]
    behind = chars[last + 1] if last + 1 < len(chars) else None
    width = behind[2] - end_column if behind is not None and behind[1] == end_line else 1
    return Span(line, column, end_line, end_column + max(width, 1))


def _decoded(node: Scalar, source: Source) -> list[Char]:
    """Return the characters of a text with their places, or none where these cannot be found."""
    if source.decoded is None or source.decoded[0] is not node:
        source.decoded = node, _found(node, source)
    return source.decoded[1]


def _found(node: Scalar, source: Source) -> list[Char]:
    """Find the characters of a text one after the other in the lines of its scalar.

    Indentation, the second of two quotes, and whatever else has no character in the text is passed
    over. A line break that YAML reads as a space is found in the indentation behind it.
    """
    found: list[Char] = []
    content = _content_of(node, source)
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
            if there == char:
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
