"""XML from strangers, read as tinyxml2 reads it for BehaviorTree.CPP: no entities, bounded.

BehaviorTree.CPP takes a bare `<` or `&` in an attribute, and no parser of XML does. So one pass
escapes them first, and notes where: each reported place is the file's.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from bt_actions.document.findings import DocumentError
from bt_actions.document.yaml.source import read_source

MOST_CHARACTERS = 4_000_000
"""Characters of one file: a thousand times as many as a large one has."""
DEEPEST = 60
"""Elements inside of each other: as many levels as a tree of ours may have."""
_OPENS = re.compile(r"<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)|<(?=[\w:/])",
                    re.DOTALL)  # fmt: skip
_INSIDE = re.compile(r"""(?P<text>"[^"]*"|'[^']*')|>""")
_BARE = re.compile(r"<|&(?!(?:lt|gt|amp|quot|apos|#[0-9]{1,7}|#x[0-9A-Fa-f]{1,6});)")

_DASH = "\u2010"


class XmlError(ValueError):
    """A file that cannot be read, and the place."""

    def __init__(self, file: str, line: int, column: int, why: str) -> None:
        super().__init__(f"{file}:{line}:{column}: {why}")
        self.file, self.line, self.column, self.why = file, line, column, why


@dataclass(slots=True)
class Element:
    """An element; line and column count from 1. `comments` stand before it, `last` at its end."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    column: int
    comments: list[str] = field(default_factory=list)
    children: list[Element] = field(default_factory=list)
    last: list[str] = field(default_factory=list)

    def walk(self) -> Iterator[Element]:
        """Yield the element and all below it, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()


def read_file(path: Path) -> Element:
    """Read a file. Raises XmlError."""
    try:
        source = read_source(path, str(path), pipes=False)
    except DocumentError as error:
        found = error.findings[0]
        why = found.message.replace("a YAML text", "XML")
        raise XmlError(str(path), found.line, found.column, why) from None
    return parse(source.text, str(path))


def parse(text: str, name: str) -> Element:
    """Read a text; `name` stands for its file. Raises XmlError."""
    if len(text) > MOST_CHARACTERS:
        raise XmlError(name, 1, 1, f"this has more than {MOST_CHARACTERS:,} characters")
    return _Parser(name, *escaped(text)).parse()


Shifts = dict[int, list[tuple[int, int]]]
"""The columns behind which characters were added, and how many, by line."""


def escaped(text: str) -> tuple[str, Shifts]:
    """Escape `<` and `&` in quoted attributes, and `&` outside; return what moved."""
    out: list[str] = []
    shifts: Shifts = defaultdict(list)
    line, start = 1, 0  # the line's begin in the new text
    length = at = 0

    def add(piece: str, more: int = 0) -> None:
        nonlocal line, start, length
        out.append(piece)
        length += len(piece)
        if "\n" in piece:
            line += piece.count("\n")
            start = length - (len(piece) - piece.rfind("\n") - 1)
        if more:
            shifts[line].append((length - start, more))

    def escape_text(piece: str) -> None:
        escape(piece) if "<" not in piece else add(piece)

    def escape(piece: str) -> None:
        done = 0
        for found in _BARE.finditer(piece):
            add(piece[done : found.start()])
            made = "&lt;" if found[0] == "<" else "&amp;"
            add(made, len(made) - 1)
            done = found.end()
        add(piece[done:])

    while (found := _OPENS.search(text, at)) is not None:
        escape_text(text[at : found.start()])
        add(_comment(found[0]) if found[0].startswith("<!--") else found[0])
        at = found.end()
        while len(found[0]) == 1 and (inside := _INSIDE.search(text, at)) is not None:
            if inside["text"] is None:
                break
            add(text[at : inside.start()])
            escape(inside[0])
            at = inside.end()
    escape_text(text[at:])
    return "".join(out), shifts


def _comment(written: str) -> str:
    """Return a comment in XML's form: without two dashes in it."""
    inside = written[4:-3]
    if "--" in inside or inside.endswith("-"):
        inside = inside.replace("-", _DASH)
    return f"<!--{inside}{written[-3:]}"


class _Parser:
    def __init__(self, name: str, text: str, shifts: Shifts) -> None:
        self._name, self._text, self._shifts = name, text, shifts
        self._expat = expat.ParserCreate("utf-8")
        self._expat.StartDoctypeDeclHandler = self._doctype
        self._expat.StartElementHandler = self._start
        self._expat.EndElementHandler = self._end
        self._expat.CommentHandler = self._comment
        self._open: list[Element] = []
        self._comments: list[str] = []
        self._root: Element | None = None

    def parse(self) -> Element:
        try:
            self._expat.Parse(self._text.encode(), True)
        except expat.ExpatError as error:
            why = expat.errors.messages[error.code]
            raise self._error(why, error.lineno, error.offset) from None
        assert self._root is not None
        return self._root

    def _place(self, line: int, column: int) -> tuple[int, int]:
        moved = sum(more for at, more in self._shifts.get(line, ()) if at <= column)
        return line, column - moved + 1

    def _error(self, why: str, line: int, column: int) -> XmlError:
        return XmlError(self._name, *self._place(line, column), why)

    def _here(self, why: str) -> XmlError:
        return self._error(why, self._expat.CurrentLineNumber, self._expat.CurrentColumnNumber)

    def _doctype(self, *_: object) -> None:
        raise self._here("a DOCTYPE, which may hold entities, has no place here")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self._open) >= DEEPEST:
            raise self._here(f"this is nested deeper than {DEEPEST} elements")
        line, column = self._place(self._expat.CurrentLineNumber, self._expat.CurrentColumnNumber)
        element = Element(tag, attributes, self._name, line, column, self._comments)
        self._comments = []
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)

    def _end(self, _tag: str) -> None:
        self._open.pop().last = self._comments
        self._comments = []

    def _comment(self, text: str) -> None:
        self._comments.append(text.replace(_DASH, "-"))
