"""``# bt: ignore[BT301] reason``: a warning silenced in place.

On the line of what it silences, or alone on a line above it. An ignore that names no rule, or an
error, or silences nothing, is an error itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from bt_actions.document.findings import Severity, Span
from bt_actions.document.findings.rules import RULES
from bt_actions.document.yaml.comments import Comment, comments_of, scalars_of
from bt_actions.document.yaml.source import Source
from bt_actions.utilities.suggest import did_you_mean

_IGNORE = re.compile(r"(?:^|(?<=\s))#\s*bt:\s*ignore\b(?:\[([^\]]*)\])?")
_CODE = re.compile(r"[^\s,]+")


def apply_ignores(source: Source, complete: Callable[[], bool]) -> None:
    """Take the silenced findings out of a source, and report what is wrong with the ignores.

    `complete` says whether all rules were tried: else no ignore is called useless.
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
    """Whether a comment silences something."""
    return _IGNORE.search(comment.text) is not None


def _targets(source: Source) -> Iterator[tuple[Comment, int]]:
    """The comments that hold an ignore, each with the line that it is about."""
    assert source.root is not None
    comments = list(comments_of(source, scalars_of(source.root)))
    ignores = [comment for comment in comments if is_ignore(comment)]
    if not ignores:
        return
    below = _lines_below(source, {comment.line for comment in comments if comment.alone})
    for comment in ignores:
        yield comment, below[comment.line] if comment.alone else comment.line


def _lines_below(source: Source, skipped: set[int]) -> list[int]:
    """For each line the next one that says something; at the end the line itself."""
    found = list(range(len(source.lines) + 1))
    later = 0
    for number in range(len(source.lines), 0, -1):
        found[number] = later or number
        if number not in skipped and source.lines[number - 1].strip():
            later = number
    return found


def _codes(source: Source, comment: Comment) -> Iterator[tuple[str, Span]]:
    """The rules that a comment names, each with its place; an ignore without one is reported."""
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
