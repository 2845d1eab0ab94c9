"""The trees that can be run, by name: looked up in named folders, never opened by a path. No ROS.

A file that changed is read again when somebody asks. One that no longer checks keeps its last good
version. What a tree includes, imports or reads must lie in the named folders, wherever links lead.
"""

from __future__ import annotations

import enum
import hashlib
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from bt_actions.document import DocumentError, Finding, Tree, open_tree
from bt_actions.serving.requests import Refused, Said, inputs_of
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.suggest import did_you_mean

__all__ = ["Catalog", "Entry", "State"]

_SUFFIXES = (".yaml", ".yml")
_LONGEST_NAME = 60
"""Characters of a name that nobody knows in what is said of it."""
RACY = 1_000_000_000
"""Nanoseconds in which two changes of a file may have the same time of change."""
_Stamp = tuple[int, int, int] | None


class State(enum.Enum):
    """How the file of a tree stands."""

    OK = 0
    KEPT_LAST_GOOD = 1
    INVALID = 2


@dataclass(frozen=True, slots=True)
class Entry:
    """A tree as it can be run at this moment."""

    name: str
    file: Path
    tree: Tree | None
    """The latest version that checks; None where there was none."""
    digest: str
    findings: tuple[Said, ...]
    """What is wrong with the file as it is now."""
    stamps: Mapping[Path, _Stamp]

    @property
    def state(self) -> State:
        """Whether its file checks, and if not, whether an older version is kept."""
        if not self.findings:
            return State.OK
        return State.INVALID if self.tree is None else State.KEPT_LAST_GOOD


class Catalog:
    """The trees in some folders. May be asked on any thread.

    Args:
        folders: where trees lie as NAME.yaml; of two of one name the first counts. Files without a
            tree (they are for others to import), and with a name that no line shows, have no entry.
        python: the packages whose classes a ``python:`` node may name.

    Raises NotADirectoryError for a folder that is none.
    """

    def __init__(self, folders: Iterable[Path], *, python: Iterable[str] = ()) -> None:
        self.folders = tuple(Path(each) for each in folders)
        for folder in self.folders:
            if not folder.is_dir():
                raise NotADirectoryError(f"{folder} is no folder of trees")
        self._python = frozenset(python)
        self._lock = threading.Lock()
        self._entries: dict[str, Entry] = {}

    def entries(self) -> list[Entry]:
        """All trees, by name."""
        with self._lock:
            files = self._files()
            found = [self._entry(name, file) for name, file in sorted(files.items())]
            self._entries = {each.name: each for each in found if each is not None}
            return list(self._entries.values())

    def find(self, name: str) -> Entry:
        """The tree of this name, as it is now. Raises Refused."""
        with self._lock:
            files = self._files()
            file = files.get(name)
            entry = None if file is None else self._entry(name, file)
            if entry is None:
                shown = name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}..."
                near = did_you_mean(name, files) or "; ListTrees tells which there are"
                raise Refused("UNKNOWN_TREE", f"there is no tree {shown!r} here{near}")
            self._entries[name] = entry
            return entry

    def check(self, name: str, inputs: str) -> tuple[Entry, Tree, Mapping[str, object]]:
        """What a goal would run: the tree as it is now, and the values of its inputs.

        Raises Refused, which says what is wrong.
        """
        entry = self.find(name)
        if entry.tree is None:
            first, more = entry.findings[0], len(entry.findings) - 1
            rest = f" (and {more} more)" if more else ""
            raise Refused(first.code, f"{first.message}{rest}", first.place)
        values = inputs_of(inputs)
        try:
            entry.tree.check_inputs(values)
        except ValueError as error:
            raise Refused("INPUTS", str(error), "inputs") from None
        return entry, entry.tree, values

    def _files(self) -> dict[str, Path]:
        found: dict[str, Path] = {}
        for folder in self.folders:
            try:
                files = sorted(folder.iterdir())
            except OSError:
                continue
            for file in files:
                if file.suffix in _SUFFIXES and clean(file.stem) == file.stem:
                    found.setdefault(file.stem, file)
        return found

    def _entry(self, name: str, file: Path) -> Entry | None:
        """The entry of a file as it is now; None for one that holds no tree."""
        before = self._entries.get(name)
        if before is not None and before.file != file:
            before = None
        if before is not None and not before.findings and _unchanged(before.stamps):
            return before
        begun = time.time_ns()
        try:
            tree = open_tree(file, python=self._python, within=self.folders)
        except DocumentError as error:
            if before is None and _holds_no_tree(error.findings):
                return None
            said = tuple(_said(each) for each in error.findings)
            if before is None:
                return Entry(name, file, None, "", said, {})
            return Entry(name, file, before.tree, before.digest, said, before.stamps)
        files = tree.files
        stamps = {path: _stamp(path, before=begun - RACY) for path in files}
        return Entry(name, file, tree, _digest(files), (), stamps)


def _holds_no_tree(findings: Iterable[Finding]) -> bool:
    return any(each.code == "BT106" and "for trees to import" in each.message for each in findings)


def _said(finding: Finding) -> Said:
    hint = f" ({finding.hint})" if finding.hint else ""
    place = f"{finding.file}:{finding.line}:{finding.column}"
    return Said(finding.code, f"{finding.message}{hint}", place)


def _stamp(path: Path, *, before: int | None = None) -> _Stamp:
    """What tells a file from what it was; None where it is not there, or not older than `before`.

    Which has been written just now may be written again without another time of change.
    """
    try:
        status = path.stat()
    except OSError:
        return None
    if before is not None and status.st_mtime_ns >= before:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def _unchanged(stamps: Mapping[Path, _Stamp]) -> bool:
    return all(stamp is not None and _stamp(path) == stamp for path, stamp in stamps.items())


def _digest(files: Mapping[Path, str]) -> str:
    """Of all files that a version is made of, in the order of their names."""
    digest = hashlib.sha256()
    for path, text in sorted(files.items()):
        data = text.encode("utf-8", "surrogatepass") or _bytes(path)
        digest.update(f"{path.name} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""
