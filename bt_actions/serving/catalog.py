"""The catalog of trees by name: looked up in named folders, never opened by a path. No ROS.

The catalog reads a changed file again at the next question. A tree whose changed file has errors
keeps its last good version. So does a tree whose file takes long to read, and the catalog does not
wait for that file again before the first read is done. All files of a tree must lie in the named
folders, or be linked there.
"""

from __future__ import annotations

import contextlib
import enum
import hashlib
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from bt_actions.document import DocumentError, Finding, Tree, open_tree
from bt_actions.document.reading.find import is_tree_file, own_folders
from bt_actions.serving.requests import GoalRefused, Mistake, inputs_of
from bt_actions.utilities.patience import Patience
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.suggest import did_you_mean

_LONGEST_NAME = 60
"""Characters of an unknown name in a message."""
PATIENCE = 2.0
"""Seconds in which a file or a folder must be read: less than a client waits for its answer."""
AT_START = 5.0
"""The same for the first read of the trees, which imports much."""
RACY = 1_000_000_000
"""Nanoseconds in which two changes of a file may have the same time of change."""
_NOT_READ = (
    f"this, or a file that it names, cannot be read: there is no answer within {PATIENCE:g} s; "
    "are their disks there?"
)
_Stamp = tuple[int, int, int] | None


class FileState(enum.Enum):
    """The state of a tree's file."""

    OK = 0
    KEPT_LAST_GOOD = 1
    INVALID = 2


@dataclass(frozen=True, slots=True)
class ServedTree:
    """A tree as it can be run at this moment."""

    name: str
    file: Path
    tree: Tree | None
    """The latest version that checks; None without one."""
    digest: str
    findings: tuple[Mistake, ...]
    """The mistakes in the present file."""
    stamps: Mapping[Path, _Stamp]
    hides: tuple[Path, ...] = ()
    """Files of the same name that are not served."""

    @property
    def state(self) -> FileState:
        """The state of its file.

        Whether it checks, and if not, whether an older version is kept.
        """
        if not self.findings:
            return FileState.OK
        return FileState.INVALID if self.tree is None else FileState.KEPT_LAST_GOOD


class Catalog:
    """The trees in some folders, for questions on any thread.

    Args:
        folders: where trees lie as NAME.yaml; of two of one name the first counts. Files without a
            tree (which others import), files whose names begin with a dot (of editors, say), and
            files with a name that no line shows have no entry.
        python: the packages whose classes a ``python:`` node may name.

    Raises NotADirectoryError for a folder that is none.
    """

    def __init__(self, folders: Iterable[Path], *, python: Iterable[str] = ()) -> None:
        self._patience = Patience(AT_START)
        self.folders = tuple(Path(each) for each in folders)
        with self._patience:
            for folder in self.folders:
                try:
                    is_folder = self._patience(folder, folder.is_dir)
                except TimeoutError:
                    raise NotADirectoryError(f"{folder}: {_NOT_READ}") from None
                if not is_folder:
                    raise NotADirectoryError(f"{folder} is no folder of trees")
        self._python = frozenset(python)
        self._lock = threading.Lock()
        self._entries: dict[str, ServedTree] = {}
        self._listed: dict[Path, list[Path]] = {}
        """The files of each folder, as of the last look."""
        self._there: list[Path] = []
        """The folders that answer."""

    def entries(self) -> list[ServedTree]:
        """Return all trees, by name."""
        with self._lock, self._patience:
            found = [self._entry(name, paths) for name, paths in sorted(self._files().items())]
            self._entries = {each.name: each for each in found if each is not None}
            self._patience.seconds = PATIENCE
            return list(self._entries.values())

    def find(self, name: str) -> ServedTree:
        """Return the tree of this name, as it is now. Raises GoalRefused."""
        with self._lock, self._patience:
            files = self._files()
            entry = self._entry(name, files.get(name, ()))
            if entry is None:
                shown = name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}..."
                near = did_you_mean(name, files) or "; ListTrees tells which there are"
                raise GoalRefused("UNKNOWN_TREE", f"there is no tree {shown!r} here{near}")
            self._entries[name] = entry
            return entry

    def check(self, name: str, inputs: str) -> tuple[ServedTree, Tree, Mapping[str, object]]:
        """Return the tree that a goal would run, as it is now, and the values of its inputs.

        Raises GoalRefused, with the reason.
        """
        entry = self.find(name)
        if entry.tree is None:
            first, more = entry.findings[0], len(entry.findings) - 1
            rest = f" (and {more} more)" if more else ""
            raise GoalRefused(first.code, f"{first.message}{rest}", first.place)
        values = inputs_of(inputs)
        try:
            entry.tree.check_inputs(values)
        except ValueError as error:
            raise GoalRefused("INPUTS", str(error), "inputs") from None
        return entry, entry.tree, values

    def _files(self) -> dict[str, list[Path]]:
        """Return the files of each name, in the order of the folders."""
        self._there = []
        for folder in self.folders:
            with contextlib.suppress(TimeoutError):
                self._listed[folder] = self._patience(folder, partial(_trees_in, folder))
                self._there.append(folder)
        found: dict[str, list[Path]] = {}
        for folder in self.folders:
            for file in self._listed.get(folder, ()):
                beside = found.setdefault(file.stem, [])
                if not any(self._same(file, each) for each in beside):
                    beside.append(file)
        return found

    def _same(self, file: Path, other: Path) -> bool:
        """Return whether two paths lead to one file, as far as the disks tell."""
        with contextlib.suppress(OSError):  # TimeoutError is one
            return self._patience((file, other), partial(file.samefile, other))
        return False

    def _entry(self, name: str, files: Sequence[Path]) -> ServedTree | None:
        """Return the entry of the first of these files that holds a tree, as it is now."""
        before = self._entries.get(name)
        for number, file in enumerate(files):
            known = before if before is not None and before.file == file else None
            there = tuple(self._there)
            try:
                if file.parent not in there:
                    raise TimeoutError  # as for its folder
                entry = self._patience(file, partial(self._read, name, file, known, there))
            except TimeoutError:
                said = Mistake("BT100", _NOT_READ, str(file))
                known = known or ServedTree(name, file, None, "", (), {})
                entry = replace(known, findings=(said,))
            if entry is not None:
                hides = tuple(files[number + 1 :])
                return entry if entry.hides == hides else replace(entry, hides=hides)
        return None

    def _read(
        self, name: str, file: Path, before: ServedTree | None, there: tuple[Path, ...]
    ) -> ServedTree | None:
        """Return the entry of a file, or None for one that holds no tree.

        The read may hang, so it changes nothing; `there` are the folders that answer.
        """
        if before is not None and not before.findings and _unchanged(before.stamps):
            return before
        begun = time.time_ns()
        try:
            tree = open_tree(file, python=self._python, within=(*there, *own_folders()))
        except DocumentError as error:
            if before is None and _holds_no_tree(error.findings):
                return None
            said = tuple(_said(each) for each in error.findings)
            if before is None:
                return ServedTree(name, file, None, "", said, {})
            return replace(before, findings=said)
        files = tree.files
        stamps = {path: _stamp(path, before=begun - RACY) for path in files}
        return ServedTree(name, file, tree, _digest(files), (), stamps)


def _trees_in(folder: Path) -> list[Path]:
    try:
        files = sorted(folder.iterdir())
    except OSError:
        return []
    return [each for each in files if is_tree_file(each) and clean(each.stem) == each.stem]


def _holds_no_tree(findings: Iterable[Finding]) -> bool:
    return any(each.code == "BT106" and "for trees to import" in each.message for each in findings)


def _said(finding: Finding) -> Mistake:
    hint = f" ({finding.hint})" if finding.hint else ""
    return Mistake(finding.code, f"{finding.message}{hint}", str(finding.place))


def _stamp(path: Path, *, before: int | None = None) -> _Stamp:
    """Return the identity of a file's version; None where the file is missing, or too new.

    A file that is not older than `before` may change again without another time of change.
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
    """Return the digest of all files of a version, in the order of their names."""
    digest = hashlib.sha256()
    for path, text in sorted(files.items()):
        data = text.encode("utf-8", "surrogatepass")
        with contextlib.suppress(OSError):
            data = data or path.read_bytes()  # of a data file
        digest.update(f"{path.name} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()
