"""Findings as text for people and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence

from bt_actions.document.findings import Finding, Severity


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
    names = ("file", "line", "column", "end_line", "end_column", "code", "severity", "message")
    plain = {name: getattr(finding, name) for name in names}
    if finding.hint:
        plain["hint"] = finding.hint
    if finding.related is not None:
        related = finding.related
        plain["related"] = {**related.place._asdict(), "message": related.message}
    return plain
