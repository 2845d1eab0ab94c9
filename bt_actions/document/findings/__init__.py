"""Findings: what is wrong with a document, and where, as values; and the error that carries them.

A finding is complete when it is made: it holds the source line, so that a finding can be shown
after the file has changed, or for a text from standard input.
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
"""The attributes of a behaviour for the node that made it, and of a loaded root for its document.
The names are such that no class of a user has them.
"""


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
    """The rule behind a code, with a wrong and a right tree, or two commands where no tree does."""

    code: str
    title: str
    text: str
    wrong: str
    right: str
    severity: Severity = Severity.ERROR

    @property
    def language(self) -> str:
        """The language of the examples."""
        return "yaml" if self.wrong.startswith(("tree:", "- ")) else "sh"

    def page(self) -> str:
        """Return the rule as plain text."""
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
    """One mistake. Lines and columns count from 1; `end_column` is one past the last."""

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
        """Return ``trees/x.yaml:14:17: error[BT203]: MoveRobot.Goal has no field 'distnace'``."""
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
    """Return the source line, cut where it is very long, and a line of carets under the range."""
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
