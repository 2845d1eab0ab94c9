"""``# bt: ignore[BT301] reason``: a warning silenced in place.

On the line of what it silences, or alone on a line above it. An ignore that names no rule, or an
error, or silences nothing, is an error itself.
"""

from __future__ import annotations

import re

from bt_actions.document.findings import Finding, Severity, Span
from bt_actions.document.rules import RULES
from bt_actions.document.source import Source
from bt_actions.suggest import did_you_mean

__all__ = ["apply_ignores"]

_IGNORE = re.compile(r"(?:^|(?<=\s))#\s*bt:\s*ignore\b(?:\[([^\]]*)\])?")
_CODE = re.compile(r"[^\s,]+")


def apply_ignores(source: Source, *, complete: bool = True) -> None:
    """Take the silenced findings out of a source, and report what is wrong with the ignores.

    `complete` is False when not all rules were tried: then no ignore is called useless.
    """
    if "ignore" not in source.text:
        return
    for number, line in enumerate(source.lines, 1):
        match = _IGNORE.search(line)
        if match is None:
            continue
        if not (match[1] or "").strip():
            span = Span(number, match.start() + 1, number, match.end() + 1)
            hint = "# bt: ignore[BT301] why"
            source.report("BT119", span, "an ignore names the rules it silences", hint=hint)
            continue
        target = number
        if not line[: match.start()].strip():
            target = _next_line(source, number)
        for code in _CODE.finditer(match[1]):
            start = match.start(1) + code.start()
            span = Span(number, start + 1, number, start + len(code[0]) + 1)
            _apply(source, code[0], target, span, complete=complete)


def _next_line(source: Source, number: int) -> int:
    for later in range(number, len(source.lines)):
        text = source.lines[later].strip()
        if text and not text.startswith("#"):
            return later + 1
    return number


def _apply(source: Source, code: str, line: int, span: Span, *, complete: bool) -> None:
    rule = RULES.get(code)
    if rule is None:
        near = did_you_mean(code, RULES)
        source.report("BT119", span, f"there is no rule {code!r}{near}")
        return
    if rule.severity is Severity.ERROR:
        source.report("BT119", span, f"{code} is an error: it cannot be silenced")
        return
    kept: list[Finding] = []
    silenced = False
    for finding in source.findings:
        if finding.code == code and finding.line == line:
            silenced = True
        else:
            kept.append(finding)
    source.findings[:] = kept
    if complete and not silenced:
        source.report("BT120", span, f"there is no {code} here to silence")
