"""The folders of recorded runs: their places, the search by a few letters, and the pruning.

Each run has a folder, called by its time, its tree and the first letters of its id, below the state
directory of the user. A summary stands beside the files of events, so that a list of runs reads no
events. A lock on the folder keeps it from being removed, and a lock on the first file shows that
the run goes on.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import shutil
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from bt_actions.utilities.plain_text import as_json, clean
from bt_actions.utilities.suggest import did_you_mean
from bt_actions.utilities.whole_file import replace_file, replacing

FIRST = "run.mcap"
"""The first file of a run in a folder of its own."""
SUCCEEDED, FAILED = 20, 100
"""Runs that are kept: successes and stopped runs, and the rest."""
BYTES = 500_000_000
"""Bytes of all kept runs together."""
_LONGEST_SUMMARY = 100_000
_TEXTS = ("run_id", "tree", "request", "caller", "status", "stopped_by", "cause", "unrecorded")
UNREADABLE = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RecursionError,
)
"""The errors of a summary that is none, or of another version."""
_STRANGE = re.compile(r"[^\w.-]+", re.ASCII)


class NoRun(LookupError):
    """A text that means no recorded run, or several."""


@dataclass(frozen=True, slots=True)
class Summary:
    """The facts of a run for a list."""

    run_id: str
    tree: str
    began: float
    """Seconds since 1970."""
    request: str = ""
    """The UUID of the RunTree goal that it answers, or ""."""
    caller: str = ""
    """The id of the run whose leaf sent that goal, where it is known."""
    where: Mapping[str, str] = field(default_factory=dict)
    """As RunBegan has it: node, domain, host, simulation."""
    status: str = ""
    """SUCCESS, FAILURE or INVALID; "" while the run goes on, and after its process was killed."""
    stopped_by: str = ""
    """The author of a stop: SIGINT, CANCELED, TIMEOUT, ..."""
    exit_code: int | None = None
    seconds: float | None = None
    cause: str = ""
    """The cause of a failure, on one line."""
    unrecorded: str = ""
    """The time and the reason of the end of recording, as ``12:03:10: the disk is full``."""

    @property
    def failed(self) -> bool:
        """Whether the run failed, was out of time, or never finished."""
        return self.status != "SUCCESS" and self.stopped_by in ("", "TIMEOUT")

    @property
    def is_simulated(self) -> bool:
        """Whether a simulation stood in for the world."""
        return "simulation" in self.where


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded run: its first file, and its facts without a read of that file."""

    first: Path
    summary: Summary
    is_written: bool
    """Whether the run goes on."""

    @property
    def parts(self) -> list[Path]:
        """The files of the run, in order; older ones of a long run are gone."""
        return parts_of(self.first)

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(map(_size, self.parts))


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:  # another process removes it
        return 0


def home() -> Path:
    """Return the folder of all recorded runs of this user, which may not exist yet."""
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "bt_actions" / "runs"


def folder_for(run_id: str, tree: str, began: float, where: Path) -> Path:
    """Make the folder of a new run, with access for this user alone. Raises OSError."""
    when = time.strftime("%Y%m%dT%H%M%S", time.gmtime(began))
    name = _STRANGE.sub("_", tree)[:60] or "tree"
    where.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder = where / f"{when}-{name}-{run_id[:8]}"
    folder.mkdir(mode=0o700)
    return folder


def parts_of(first: Path) -> list[Path]:
    """Return the files of the run that `first` begins, in order."""
    numbered = re.compile(rf"{re.escape(first.stem)}\.(\d+)\.mcap")
    found = [
        (int(match[1]), each)
        for each in first.parent.glob("*.mcap")
        if (match := numbered.fullmatch(each.name))
    ]
    return [*([first] if first.exists() else []), *(each for _, each in sorted(found))]


# Summaries


def summary_of(first: Path) -> Path:
    """Return the summary file beside the first file."""
    return first.with_suffix(".json")


def write_summary(first: Path, summary: Summary) -> None:
    """Write the summary beside the first file. Raises OSError."""
    path = summary_of(first)
    replace_file(path, as_json(asdict(summary)).encode())
    path.chmod(0o600)


def read_summary(first: Path) -> Summary | None:
    """Return the summary, or None for an unreadable one."""
    try:
        return read_fields(summary_of(first))[0]
    except UNREADABLE:
        return None


def read_fields(path: Path) -> tuple[Summary, Any]:
    """Return a summary, and all fields of its file; raises one of UNREADABLE."""
    with path.open("rb") as file:
        data: Any = json.loads(file.read(_LONGEST_SUMMARY))
    text = {name: clean(str(data.get(name) or "")) for name in _TEXTS}
    where = {clean(name): clean(str(each)) for name, each in data.get("where", {}).items()}
    code, seconds = data.get("exit_code"), data.get("seconds")
    began = float(data["began"])
    time.localtime(began)  # raises for a time that no clock can show
    read = Summary(
        **text,
        began=began,
        where=where,
        exit_code=None if code is None else int(code),
        seconds=None if seconds is None else float(seconds),
    )
    return read, data


# All of them


def recorded(where: Path | None = None) -> list[Recorded]:
    """Return all recorded runs of this user, the newest first."""
    folder = home() if where is None else where
    try:
        found = [run for each in folder.iterdir() if (run := _seen(each / FIRST)) is not None]
    except OSError:
        return []
    return sorted(found, key=lambda each: each.summary.began, reverse=True)


def _seen(first: Path) -> Recorded | None:
    try:
        if not first.is_file():
            return None
        return Recorded(first, read_summary(first) or _guessed(first), is_written(first))
    except OSError:  # another user's, or another process removes it
        return None


def _guessed(first: Path) -> Summary:
    """Return the summary that a folder's name allows where the summary is lost."""
    _, _, rest = first.parent.name.partition("-")
    tree, _, run_id = rest.rpartition("-")
    return Summary(clean(run_id), clean(tree), first.stat().st_mtime)


def find(text: str = "", where: Path | None = None) -> Path:
    """Return the first file of the run that is meant.

    A path, the first letters of an id, or a tree (its newest run); the newest of all without a
    text. Raises NoRun.
    """
    path = Path(text).expanduser()
    if text:
        found = [path / FIRST, *sorted(path.glob("*.mcap"))] if path.is_dir() else [path]
        if files := [each for each in found if each.is_file()]:
            return files[0]
    if "/" in text or path.suffix == ".mcap":
        raise NoRun(f"{text} is no recording: a folder with {FIRST}, or an .mcap file, is one")
    runs = recorded(where)
    if not runs:
        raise NoRun(f"no run is recorded yet in {home() if where is None else where}")
    meant = [each for each in runs if each.summary.run_id.startswith(text.lower())]
    if not text or len(meant) == 1:
        return (meant or runs)[0].first
    of_tree = [each for each in runs if each.summary.tree == text]
    if of_tree:
        return of_tree[0].first
    if meant:
        raise NoRun(f"{text} begins {len(meant)} ids: give more letters of one")
    known = {each.summary.tree for each in runs}
    raise NoRun(
        f"no recorded run has an id or a tree {text!r}{did_you_mean(text, known)}: "
        "`bt-actions runs` lists them"
    )


# Locks


@contextlib.contextmanager
def held(path: Path, *, alone: bool = False, waits: bool = False) -> Iterator[bool]:
    """Hold a folder, so that no process removes it, or alone a first file, as its writer does.

    Yields whether the lock is held: False where another process holds it alone, or with `alone` at
    all, unless the caller waits for that to end. Raises OSError.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        how = fcntl.LOCK_EX if alone else fcntl.LOCK_SH
        try:
            fcntl.flock(descriptor, how | (0 if waits else fcntl.LOCK_NB))
            is_held = True
        except BlockingIOError:
            is_held = False
        yield is_held
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def locked(path: Path, data: bytes) -> Iterator[None]:
    """Hold a new file with some data alone: the file is locked from its first sight on.

    A process that is killed leaves the file unlocked. Raises OSError.
    """
    with replacing(path) as file:
        file.write(data)
        lock = os.dup(file.fileno())
        fcntl.flock(lock, fcntl.LOCK_EX)
    try:
        yield
    finally:
        os.close(lock)


def is_written(first: Path) -> bool:
    """Return whether a process writes the run, or finishes its files."""
    try:
        with held(first) as is_free:  # not alone, so that no asker looks like a writer
            return not is_free
    except OSError:
        return False


def prune(
    where: Path | None = None,
    *,
    succeeded: int = SUCCEEDED,
    failed: int = FAILED,
    size: int = BYTES,
) -> list[Recorded]:
    """Remove the oldest runs beyond the limits; return them. Never raises for a folder."""
    left, gone, total = {False: succeeded, True: failed}, list[Recorded](), 0
    for run in recorded(where):
        mine, kind = run.size, run.summary.failed
        total += mine
        left[kind] -= not run.is_written
        if run.is_written or (left[kind] >= 0 and total <= size):
            continue
        with contextlib.suppress(OSError), held(run.first.parent, alone=True) as alone:
            if alone:
                shutil.rmtree(run.first.parent)
                total -= mine
                gone.append(run)
    return gone
