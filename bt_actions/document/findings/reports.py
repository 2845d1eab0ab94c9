"""Findings in the four forms that people and tools read: text, JSON, GitHub, SARIF.

Pure functions from findings to text.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import PurePath
from types import MappingProxyType
from urllib.parse import quote

from bt_actions.document.findings import Finding, Severity
from bt_actions.document.findings.rules import RULES


def as_text(findings: Sequence[Finding], width: int = 200) -> str:
    """As a compiler prints them, errors first, with a count at the end; source lines are cut to
    `width`. The forms for tools keep the order of places."""
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
    """One list of objects."""
    plain = [_plain(finding) for finding in findings]
    return json.dumps(plain, indent=2, ensure_ascii=False) + "\n"


def as_github(findings: Sequence[Finding]) -> str:
    """Workflow commands, which GitHub Actions turns into annotations of the changed lines."""
    return "".join(
        f"::{finding.severity} file={_escaped(finding.file, ':,')},line={finding.line},"
        f"col={finding.column},endLine={finding.end_line},endColumn={finding.end_column},"
        f"title={finding.code}::{_escaped(_with_hint(finding), '')}\n"
        for finding in findings
    )


def as_sarif(findings: Sequence[Finding]) -> str:
    """SARIF 2.1.0 (OASIS), which code-scanning services read."""
    used = sorted({finding.code for finding in findings})
    rules = [
        {
            "id": code,
            "shortDescription": {"text": RULES[code].title},
            "defaultConfiguration": {"level": RULES[code].severity.value},
        }
        for code in used
    ]
    log = {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [
            {
                "tool": {"driver": {"name": "bt-actions", "rules": rules}},
                "columnKind": "unicodeCodePoints",
                "results": [_sarif_result(finding, used) for finding in findings],
            }
        ],
    }
    return json.dumps(log, indent=2, ensure_ascii=False) + "\n"


REPORTS: Mapping[str, Callable[[Sequence[Finding]], str]] = MappingProxyType(
    {"text": as_text, "json": as_json, "github": as_github, "sarif": as_sarif}
)
"""The forms by name."""


def _plain(finding: Finding) -> dict[str, object]:
    plain = asdict(finding)
    del plain["source_line"]
    if finding.related is not None:
        plain["related"] = {**finding.related.place._asdict(), "message": finding.related.message}
    return {name: value for name, value in plain.items() if value}


def _with_hint(finding: Finding) -> str:
    return f"{finding.message} ({finding.hint})" if finding.hint else finding.message


def _escaped(text: str, more: str) -> str:
    """As workflow commands want it: percent, line ends, and in properties also `more`."""
    for char in "%\r\n" + more:
        text = text.replace(char, f"%{ord(char):02X}")
    return text


def _sarif_result(finding: Finding, used: list[str]) -> dict[str, object]:
    region = {
        "startLine": finding.line,
        "startColumn": finding.column,
        "endLine": finding.end_line,
        "endColumn": finding.end_column,
    }
    result: dict[str, object] = {
        "ruleId": finding.code,
        "ruleIndex": used.index(finding.code),
        "level": finding.severity.value,
        "message": {"text": _with_hint(finding)},
        "locations": [_sarif_place(finding.file, region)],
    }
    if finding.related is not None:
        place, message = finding.related.place, {"text": finding.related.message}
        region = {"startLine": place.line, "startColumn": place.column}
        result["relatedLocations"] = [{**_sarif_place(place.file, region), "message": message}]
    return result


def _sarif_place(file: str, region: dict[str, int]) -> dict[str, object]:
    uri = quote(os.fsencode(PurePath(file).as_posix()))
    return {"physicalLocation": {"artifactLocation": {"uri": uri}, "region": region}}
