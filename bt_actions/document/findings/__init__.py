"""What is wrong with a document, and where: values, and the one error that carries them.

A finding is complete when it is made: it holds the source line, so that it can be shown after the
file has changed or when it came from standard input.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from bt_actions.utilities.shorten import fit

NODE = "_bt_actions_node"
LOADED = "_bt_actions_loaded"
"""The attribute of a behaviour that has the node it was made from, and that of a loaded root which
has its document. Not such as a user's own class may have."""


class Place(NamedTuple):
    """A position in a file; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


class Span(NamedTuple):
    """A range in a text; lines and columns count from 1, the end column is one past the last."""

    line: int
    column: int
    end_line: int
    end_column: int


class Severity(StrEnum):
    """Whether a tree with this finding can run."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Rule:
    """What a code stands for, with two trees, or for what no tree can show with two commands."""

    code: str
    title: str
    text: str
    wrong: str
    right: str
    severity: Severity = Severity.ERROR

    @property
    def language(self) -> str:
        """What the examples are written in."""
        return "yaml" if self.wrong.startswith(("tree:", "- ")) else "sh"

    def page(self) -> str:
        """All of it as plain text."""
        title = f"{self.code}: {self.title} ({self.severity})"
        parts = [title, "", textwrap.fill(self.text, 88), ""]
        for word, example in (("Wrong", self.wrong), ("Right", self.right)):
            parts += [f"{word}:", "", textwrap.indent(example.rstrip("\n"), "    "), ""]
        return "\n".join(parts)


@dataclass(frozen=True, slots=True)
class Related:
    """A second place that helps to understand a finding ("declared here")."""

    place: Place
    message: str


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing wrong. Lines and columns count from 1; `end_column` is one past the last."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    code: str
    severity: Severity
    message: str
    hint: str | None = None
    related: Related | None = None
    source_line: str | None = None

    @property
    def place(self) -> Place:
        """File, line and column."""
        return Place(self.file, self.line, self.column)

    def headline(self) -> str:
        """``trees/x.yaml:14:17: error[BT203]: MoveRobot.Goal has no field 'distnace'``"""
        return f"{self.place}: {self.severity}[{self.code}]: {fit(self.message, 250)}"

    def __str__(self) -> str:
        return self.text()

    def text(self, width: int = 200) -> str:
        """Return the finding in a compiler's form; the source line is cut to `width` columns."""
        lines = [self.headline()]
        if self.source_line is not None:
            lines += _excerpt(self, width)
        if self.hint:
            lines.append(f"  hint: {fit(self.hint)}")
        if self.related is not None:
            lines.append(f"  {self.related.place}: {fit(self.related.message)}")
        return "\n".join(lines)


class DocumentError(ValueError):
    """A document that cannot be used; `findings` holds everything that is wrong with it.

    The fault is the document's author's. The text reads like a compiler's output.
    """

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings: Sequence[Finding] = tuple(findings)
        super().__init__("\n".join(str(finding) for finding in self.findings))


def _excerpt(finding: Finding, width: int) -> list[str]:
    """The source line with a caret under the exact range, cut where it is very long."""
    text = finding.source_line or ""
    if not text.isprintable():  # a tab, or the end of a line to some terminals
        text = "".join(char if char.isprintable() else " " for char in text)
    gutter = " " * len(str(finding.line))
    room = max(20, width - len(gutter) - len("  | "))
    start = finding.column - 1
    end = finding.end_column - 1 if finding.end_line == finding.line else len(text)
    skipped = 0 if max(start + 1, min(end, len(text))) <= room else max(0, start - room // 2)
    shown = text[skipped : skipped + room]
    if skipped:
        shown = f"…{shown[1:]}"
    if skipped + room < len(text):
        shown = f"{shown[:-1]}…"
    start, end = start - skipped, min(end - skipped, len(shown))
    carets = "^" * max(1, end - start)
    return [f" {finding.line} | {shown}".rstrip(), f" {gutter} | {' ' * start}{carets}"]
