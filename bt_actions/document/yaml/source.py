"""The text of a document, read within bounds. No YAML here.

The reading of a file takes at most `MAX_BYTES` of memory, whatever the path leads to.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import time
import unicodedata
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from bt_actions.document.findings import DocumentError, Finding, Related, Severity, Span
from bt_actions.document.findings.rules import RULES

if TYPE_CHECKING:
    from bt_actions.document.yaml.nodes import Node

MAX_BYTES = 32 * 1024 * 1024
"""The largest file that is read; a tree of 100,000 nodes has about a third of this."""
MAX_ERRORS = 1000
"""Errors in a file after which the checker stops: each costs time to explain."""
SUFFIXES = (".yaml", ".yml", ".json")
"""The endings of files that a tree may name."""
_CHUNK = 65_536
PIPE_PATIENCE = 5.0
"""Seconds in which a writer must begin to write to a named pipe."""
Char = tuple[str, int, int]
"""A character of a text, and the line and column where it is written, from 1."""
_FORBIDDEN = re.compile(
    "[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufdcf\ufdf0-\ufffd\U00010000-\U0010ffff]"
)
_PLAIN = bytes([9, 10, 13, *range(32, 127)])
"""The only bytes of most texts: none of these is forbidden, which is seen faster than by search."""
_UNSEEN = re.compile("[\x85\xa0\u1680\u2000-\u200d\u2028\u2029\u202f\u205f\u2060\u3000\ufeff]")
"""Characters that look like a space, or like nothing."""
_QUOTES = "“”„«»‘’‚"
_QUOTED = re.compile(f"[{_QUOTES}]([^{_QUOTES}\"']+)[{_QUOTES}\"']")
_DASHED = re.compile("[‐‑–—−][0-9.]")
"""A number behind a character that looks like a minus sign."""


class TooManyErrors(Exception):
    """A document with more errors than anybody wants to read: its source holds them.

    A caller must refuse the document, as the rest of the text was not read.
    """


@dataclass(slots=True)
class Unread:
    """Reported parts of a document, which are read no further; `unread.py` says what follows."""

    nodes: list[Node] = field(default_factory=list)
    meant: set[str] = field(default_factory=set)
    """Names that unknown names probably stand for."""
    names: bool = False
    """Whether any name may be declared unseen: in a missing file, as a loop's item."""
    variables: bool = False
    """Whether a variable is unknown, without a hint which is meant."""
    actions: bool = False
    """Whether a node's kind is unknown."""


@dataclass(slots=True, eq=False)
class Source:
    """The text of a document, the name of the document, and the findings in it so far."""

    name: str
    text: str
    path: Path | None = None
    findings: list[Finding] = field(default_factory=list)
    anchored: bool = False
    """Whether the text names parts of itself (&name); known once it is composed."""
    root: Node | None = None
    """The text as YAML nodes, once it is composed."""
    unread: Unread = field(default_factory=Unread)
    settled: set[Span] = field(default_factory=set)
    """Scalars that need no further finding."""
    decoded: tuple[Node, list[Char]] | None = None
    """The last scalar that written.py decoded, and the places of its characters."""
    within: tuple[Path, ...] | None = None
    """The folders that hold every file this document may name; None: anywhere."""
    files: dict[Path, object] = field(default_factory=dict)
    """The data of other files that the document names, or the ValueError of the reading."""
    items: int = 0
    """Items of such data, each counted as often as the document names it."""
    errors: int = 0
    """The number of findings that keep the tree from running."""
    commented: frozenset[int] = field(init=False)
    """The numbers of the lines that hold a '#'."""
    _lines: list[str] | None = None

    def __post_init__(self) -> None:
        numbers = enumerate(self.lines, 1) if "#" in self.text else ()
        self.commented = frozenset(number for number, line in numbers if "#" in line)

    @property
    def lines(self) -> list[str]:
        """The lines as YAML 1.2 and editors count them, without their ends."""
        if self._lines is None:
            text = self.text.replace("\r\n", "\n").replace("\r", "\n")
            self._lines = text.removesuffix("\n").split("\n") if text else []
        return self._lines

    def line(self, number: int) -> str | None:
        """Return line `number` (from 1), or None past the end."""
        lines = self.lines
        return lines[number - 1] if 0 < number <= len(lines) else None

    def refusal(self, path: Path) -> str:
        """Return why the document may not name this file; or "".

        By its name, or by where links lead, a file must lie in one of the folders: the owner of a
        folder made the links in it. A link counts only by its place in the name: `link/../x` is
        beside the target of the link.
        """
        if self.within is None:
            return ""
        named = absolute(path)
        try:
            resolved = path.resolve()
            lies = {resolved, named} if named.resolve() == resolved else {resolved}
        except (OSError, RuntimeError):
            return f"{path.name} cannot be found"
        if any(each.is_relative_to(folder) for each in lies for folder in self.within):
            return ""
        return f"{path.name} lies outside of the folders whose trees are served"

    def report(
        self,
        code: str,
        span: Span,
        message: str,
        *,
        hint: str | None = None,
        related: Related | None = None,
    ) -> None:
        """File a finding with the severity of its rule. Raises TooManyErrors with `MAX_ERRORS`."""
        if span in self.settled:
            return
        is_error = RULES[code].severity is Severity.ERROR
        if is_error:
            hint = self._look_alike(code, span, message) or hint
            if self.errors >= MAX_ERRORS:
                raise TooManyErrors
            self.errors += 1
            if self.errors == MAX_ERRORS:
                rest = f"after {MAX_ERRORS:,} errors the rest of a file is not checked"
                hint = f"{hint}; {rest}" if hint else rest
        line = self.line(span.line)
        if (span.end_line, span.end_column) <= (span.line, span.column):
            span = Span(span.line, span.column, span.line, span.column + 1)
        self.findings.append(
            Finding(
                self.name, span.line, span.column, span.end_line, span.end_column, code,
                RULES[code].severity, message, hint, related, line,
            )
        )  # fmt: skip
        if is_error and self.errors == MAX_ERRORS:
            raise TooManyErrors

    def _look_alike(self, code: str, span: Span, message: str) -> str | None:
        """Name a character that looks like a space, a quote or a minus sign, and may be the cause.

        A space is looked for in the indentation and at the place itself. A syntax error may come
        from anywhere on the line, or from the line above.
        """
        line = self.line(span.line) or ""
        end = span.end_column - 1 if span.end_line == span.line else len(line)
        parts = [line[: len(line) - len(line.lstrip())], line[span.column - 1 : end]]
        if code == "BT102":
            parts = [line, self.line(span.line - 1) or ""]
        if (inside := unquoted(parts[1])) is not None:
            return f"{parts[1][0]} is a typographic quote: write {inside}"
        if _DASHED.match(parts[1]):
            return f"{parts[1][0]} is no minus sign: write -{parts[1][1:]}"
        odd = _UNSEEN.search("\n".join(parts))
        if odd is None or spoken(odd[0]) in message:
            return None
        return f"{spoken(odd[0])} stands here: type this without it"

    @property
    def has_errors(self) -> bool:
        """Whether a finding so far keeps the tree from running."""
        return self.errors > 0


def read_source(path: Path, name: str | None = None, *, pipes: bool = True) -> Source:
    """Read the source in a file. Raises DocumentError where the file cannot be read as text.

    The writer of a pipe may keep its reader waiting: `pipes=False` refuses a pipe, for paths that
    stand in a tree and are not the user's.
    """
    name = name or str(path)
    try:
        status = path.stat()
        mode, size = status.st_mode, min(status.st_size, MAX_BYTES)
        if stat.S_ISDIR(mode):
            raise _unreadable(name, "this is a directory, not a tree")
        if stat.S_ISFIFO(mode) and not pipes:
            raise _unreadable(name, "this is a pipe, which a tree cannot name")
        if stat.S_ISFIFO(mode):
            return source_of(_read_pipe(path, name), name, path)
        if not stat.S_ISREG(mode):
            raise _unreadable(name, "this is no regular file")
        with path.open("rb", buffering=0) as stream:
            data = stream.read(size + 1)  # to ask for more takes that much memory at once
            while len(data) <= MAX_BYTES and (more := stream.read(_CHUNK)):
                data += more  # a growing file, or one of unknown size
    except DocumentError:  # is a ValueError, too
        raise
    except (OSError, ValueError) as error:
        why = f"this cannot be read: {_reason(error)}"
        if isinstance(error, FileNotFoundError):
            why = "there is no such file"
        link = broken_link(path)
        raise _unreadable(name, f"this is {link}" if link else why) from None
    return source_of(data, name, path)


def absolute(path: Path) -> Path:
    """Return the path from the root, without "..", by its words alone: links are not followed."""
    return Path(os.path.abspath(path))  # noqa: PTH100 - `Path.absolute` keeps ".."


def broken_link(path: Path) -> str:
    """Describe a link that leads to no file: ``a link to Y, which is not there``; else ""."""
    if not os.path.islink(path):  # noqa: PTH114 - `Path.is_symlink` raises for too long a name
        return ""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return f"a link to {os.path.realpath(path)}, which is not there"
    except OSError as error:
        return "a link that leads round in a circle" if error.errno == errno.ELOOP else ""
    return ""


def read_stream(stream: BinaryIO | None, name: str) -> Source:
    """Read the source in a stream; None is a closed one. Raises DocumentError as `read_source`."""
    if stream is None:
        raise _unreadable(name, "this is closed: there is nothing to read")
    try:
        data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise _unreadable(name, f"this cannot be read: {_reason(error)}") from None
    return source_of(data, name)


def _read_pipe(path: Path, name: str) -> bytes:
    """Read a pipe (`<(command)` of a shell is one), once a writer writes to it.

    An ordinary open would wait for a writer without end.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with open(descriptor, "rb") as stream:  # noqa: PTH123 - a descriptor has no path
        deadline = time.monotonic() + PIPE_PATIENCE
        first = _first_bytes(descriptor)
        while first == b"" and time.monotonic() < deadline:
            time.sleep(0.01)  # nothing tells of a writer who has only opened the pipe
            first = _first_bytes(descriptor)
        if first == b"":
            raise _unreadable(name, f"nobody wrote to this pipe within {PIPE_PATIENCE:g} s")
        os.set_blocking(descriptor, True)
        return (first or b"") + stream.read(MAX_BYTES + 1)


def _first_bytes(descriptor: int) -> bytes | None:
    """Return the first bytes in a pipe; b"" without a writer, None while a writer is silent."""
    try:
        return os.read(descriptor, MAX_BYTES)
    except BlockingIOError:
        return None


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def source_of(data: bytes, name: str, path: Path | None = None) -> Source:
    """Make the source of some bytes. Raises DocumentError where they are no usable text."""
    if len(data) > MAX_BYTES:
        raise _unreadable(name, f"this is larger than {MAX_BYTES // 1024 // 1024} MiB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8", "replace")
        line, column = before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
        raise _unreadable(
            name, f"byte 0x{data[error.start]:02x} is no UTF-8", "BT101", line, column
        ) from None
    source = Source(name, text, path)
    bad = _FORBIDDEN.search(text) if data.translate(None, _PLAIN) else None
    if bad is not None:
        line = text.count("\n", 0, bad.start()) + 1
        column = bad.start() - (text.rfind("\n", 0, bad.start()) + 1) + 1
        raise _unreadable(
            name, f"the character U+{ord(bad[0]):04X} cannot stand in a YAML text", "BT101",
            line, column,
        )  # fmt: skip
    return source


def unquoted(text: str) -> str | None:
    """Return the text inside typographic quotes, where a text is in such quotes."""
    found = _QUOTED.fullmatch(text) if text[:1] in _QUOTES else None
    return None if found is None else found[1]


def spoken(char: str) -> str:
    """Return the name of a character that nobody sees."""
    known = {"\t": "a tab", "\n": "a line break", "\x85": "U+0085 (next line)"}.get(char)
    return known or f"U+{ord(char):04X} ({unicodedata.name(char, 'no name').lower()})"


def _unreadable(
    name: str, message: str, code: str = "BT100", line: int = 1, column: int = 1
) -> DocumentError:
    return DocumentError(
        [Finding(name, line, column, line, column + 1, code, RULES[code].severity, message)]
    )
