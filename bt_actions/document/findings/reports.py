"""Findings as text for people and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence

from bt_actions.document.findings import Finding, Severity

__all__ = ["as_json", "as_text"]


def as_text(findings: Sequence[Finding], width: int = 200) -> str:
    """Write findings as a compiler does: errors first, source lines cut to `width`, and a count."""
    if not findings:
        return ""
    findings = sorted(findings, key=lambda one: one.severity is not Severity.ERROR)
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    warnings = len(findings) - errors
    counts = [f"{n} {word}{'s' if n != 1 else ''}"
              for n, word in ((errors, "error"), (warnings, "warning")) if n]  # fmt: skip
    blocks = "\n".join(finding.text(width) for finding in findings)
    return f"{blocks}\n{' and '.join(counts)}; `bt-actions explain CODE` says more\n"


def as_json(findings: Sequence[Finding]) -> str:
    """Write one list of objects, in the order of places."""
    plain = [_plain(finding) for finding in findings]
    return json.dumps(plain, indent=2, ensure_ascii=False) + "\n"


def _plain(finding: Finding) -> dict[str, object]:
    plain: dict[str, object] = {
        "file": finding.file,
        "line": finding.line,
        "column": finding.column,
        "end_line": finding.end_line,
        "end_column": finding.end_column,
        "code": finding.code,
        "severity": finding.severity.value,
        "message": finding.message,
    }
    if finding.hint:
        plain["hint"] = finding.hint
    if finding.related is not None:
        place = finding.related.place
        plain["related"] = {
            "file": place.file,
            "line": place.line,
            "column": place.column,
            "message": finding.related.message,
        }
    return plain
