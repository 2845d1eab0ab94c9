"""What this process has sent and no server has answered yet, on record should it be killed. No ROS.

A server shows the goals that it has accepted. Of one that it has received, and has not decided on
yet, nobody knows but the sender, and a sender that is killed tells nobody; the robot moves later.
So each process keeps a file of its goals without an answer, its ledger, which outlives it, and
which cleanup reads (recovery/unanswered.py). It lies in memory (/dev/shm), so that writing it waits
for no disk.

The file is named by the bytes that all goal ids of its process begin with (goals/ids.py). A goal
has a row of fixed length, which is written in place before the goal is sent, and blanked when it
has been answered. A process that ends in good order removes the file, but for goals whose server
went away: that may only stand still. What is read is believed no further than that a question about
a goal is worth asking.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
import re
import stat
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from bt_actions.goals.ids import Author, author_of

DIRECTORY = "BT_ACTIONS_LEDGER"
"""The environment variable that names another directory: one that outlives a container, say."""
LENGTH = 1024
"""Bytes of a row: the longest action name has 255."""
ROWS_AT_MOST = 4096
"""Goals on record at a time; no more are read, either."""
SERVERS_AT_MOST = 8
"""Servers of a goal on record; where there are more, none is."""
KEPT_FOR = 86400.0
"""Seconds after which a file is removed that nobody has cleaned up, also those of a suspended
machine, whatever becomes of its wall clock."""
ACCEPT_LONGEST = KEPT_FOR
"""Seconds that a server may be given to decide, as far as the record goes."""
TIDIED_AT_MOST = 16
"""Files that a process which opens its own looks at, whether they can be removed."""
_BLANK = b" " * (LENGTH - 1)
_PREFIX = 12
_SUFFIX = ".goals"
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_NAME_AT_MOST = 255


# What a process writes of itself


class Ledger:
    """This process's file. Under its caller's lock; nothing here raises.

    `complain` is called once with why a goal is not on record, should that happen.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        self._complain = complain
        self._complained = False
        self._file: int | None = None
        self._path = Path()
        self._prefix = b""
        self._identity = (0, 0)
        self._rows: dict[bytes, tuple[int, bytes]] = {}
        self._blank: list[int] = []
        self._unused = 0

    def __contains__(self, goal_id: bytes) -> bool:
        """Whether a goal is on record."""
        return goal_id in self._rows

    def enter(
        self,
        goal_id: bytes,
        action: str,
        domain: int,
        servers: Collection[bytes],
        *,
        accept: float | None = None,
        lost: bool = False,
    ) -> None:
        """Put a goal on record that is about to be sent, or what more is known of it.

        `accept`: the seconds that its server is given to decide.
        """
        entry = {
            "goal": goal_id.hex(),
            "domain": domain,
            "action": action,
            "servers": sorted(each.hex() for each in servers)
            if len(servers) <= SERVERS_AT_MOST
            else [],
            "accept": min(accept or 0.0, ACCEPT_LONGEST),
            "lost": lost,
            "at": round(_boot_time(), 1),
        }
        is_new = goal_id not in self._rows
        text = json.dumps(entry).encode().ljust(LENGTH - 1) + b"\n"
        try:
            if len(text) > LENGTH:
                raise OSError(errno.EMSGSIZE, os.strerror(errno.EMSGSIZE))
            self._see_to_the_file(goal_id[:_PREFIX])
            self._write(goal_id, text)
        except OSError as error:
            if is_new:
                self.strike(goal_id)
            self._fail(error)

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""
        row, _text = self._rows.pop(goal_id, (None, b""))
        if row is None or self._file is None:
            return
        self._blank.append(row)
        try:
            if self._is_ours():
                os.pwrite(self._file, _BLANK, row * LENGTH)
        except OSError as error:
            self._fail(error)

    def close(self) -> None:
        """Remove the file, where nothing is on record; the next goal opens another."""
        if self._file is None or self._rows:
            return
        with contextlib.suppress(OSError):
            if not _read(self._path).strip():  # or it is of the program before an exec
                self._path.unlink()
        self.disown()

    def disown(self) -> None:
        """Let go of the file, as the child of a fork: it is the parent's."""
        if self._file is not None and self._is_ours():
            with contextlib.suppress(OSError):
                os.close(self._file)
        self._file, self._prefix = None, b""
        self._rows, self._blank, self._unused = {}, [], 0

    def _write(self, goal_id: bytes, text: bytes) -> None:
        if self._file is None:
            return
        row, _text = self._rows.get(goal_id, (None, b""))
        if row is None:
            row = self._blank.pop() if self._blank else self._unused
            if row >= ROWS_AT_MOST:
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
            self._unused = max(self._unused, row + 1)
        self._rows[goal_id] = row, text
        if os.pwrite(self._file, text, row * LENGTH) < LENGTH:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _see_to_the_file(self, prefix: bytes) -> None:
        """Have it open, and in its place: whoever logs out may have all of /dev/shm removed."""
        if prefix != self._prefix:
            self.disown()
            self._open(prefix)
        elif self._file is not None and not (self._is_ours() and os.fstat(self._file).st_nlink):
            gone, rows = self._file if self._is_ours() else None, self._rows
            before, unused = self._identity, self._unused
            self._open(prefix)
            if gone is not None:
                os.close(gone)
            if self._identity == before:  # it was closed, and is as it was
                self._unused = unused
                return
            self._rows, self._blank = {}, []
            for goal_id, (_row, text) in rows.items():
                self._write(goal_id, text)

    def _is_ours(self) -> bool:
        """Whether the descriptor is still our file: who closes all may have closed it, too."""
        try:
            seen = os.fstat(-1 if self._file is None else self._file)
        except OSError:
            return False
        return (seen.st_dev, seen.st_ino) == self._identity

    def _open(self, prefix: bytes) -> None:
        home = directory()
        _tidy(home)
        path = home / (prefix.hex() + _SUFFIX)
        how = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        self._file = os.open(path, how, 0o600)
        self._path, self._prefix = path, prefix
        seen = os.fstat(self._file)
        self._identity = seen.st_dev, seen.st_ino
        # What is there is of the program that this one has replaced (exec).
        self._unused = -(-seen.st_size // LENGTH)

    def _fail(self, error: OSError) -> None:
        if not self._complained:
            self._complained = True
            self._complain(
                "should this process be killed, goals that no server has answered yet cannot be "
                f"cleaned up: they cannot be put on record: {error}"
            )


# What is read of those that are dead


@dataclass(frozen=True, slots=True)
class Sent:
    """A goal that a process sent, of whose answer that process knew nothing when it ended."""

    goal_id: bytes
    action: str
    domain: int
    """ROS domain id."""
    servers: frozenset[bytes]
    """GIDs of the servers that were in sight; none where they are not known."""
    accept: float
    """Seconds that its server was given to decide; 0: nobody said."""
    lost: bool
    """They had gone, as far as was known; but they may only have stood still."""
    at: float
    """Seconds since the start of the machine when it was sent, or lost."""
    author: Author
    """Who is dead, or not `here`."""
    path: Path
    row: int


def left_behind(
    failed: Callable[[OSError], None], passed_over: Collection[Path] = ()
) -> Iterator[tuple[Path, list[Sent]]]:
    """Find the files of this user's processes that are dead, or elsewhere, and what is in them.

    Those in `passed_over` are not read. What is damaged is skipped. `failed` is called with what
    cannot be read, or others may have put there.
    """
    try:
        directory = _directory()
        _check(directory)
        paths = sorted(directory.glob("*" + _SUFFIX))
    except FileNotFoundError:
        return
    except OSError as error:
        failed(error)
        return
    for path in paths:
        author = _author(path)
        if path in passed_over or author is None or (author.here and author.alive):
            continue
        try:
            goals, damaged = _parse_all(path, author)
        except OSError as error:
            failed(error)
            continue
        if damaged and author.here:
            what = "damaged, or of another version (remove it when nothing runs there)"
            failed(OSError(errno.EBADMSG, what, str(path)))
        yield path, goals


def strike_left(goals: Iterable[Sent]) -> None:
    """Blank the rows of goals that need not be asked for any more; where that fails, they are."""
    by_path: dict[Path, list[int]] = {}
    for sent in goals:
        by_path.setdefault(sent.path, []).append(sent.row)
    for path, rows in by_path.items():
        with contextlib.suppress(OSError):
            file = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
            try:
                for row in rows:
                    os.pwrite(file, _BLANK, row * LENGTH)
            finally:
                os.close(file)
            if not _read(path).strip():
                path.unlink()


def mark_lost(goals: Iterable[Sent]) -> None:
    """Have it on record that the servers of these goals are not in sight."""
    for sent in goals:
        with contextlib.suppress(OSError, ValueError):
            file = os.open(sent.path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
            try:
                entry = json.loads(os.pread(file, LENGTH, sent.row * LENGTH)) | {"lost": True}
                text = json.dumps(entry).encode().ljust(LENGTH - 1) + b"\n"
                if len(text) == LENGTH:
                    os.pwrite(file, text, sent.row * LENGTH)
            finally:
                os.close(file)


def directory() -> Path:
    """Make the directory of the records where it is not there. Raises OSError for an unsafe one."""
    found = _directory()
    found.mkdir(mode=0o700, parents=True, exist_ok=True)
    _check(found)
    return found


def _directory() -> Path:
    """Return where the records are. Raises OSError where that depends on where one stands."""
    named = os.environ.get(DIRECTORY)
    if named and not Path(named).is_absolute():
        raise OSError(errno.EINVAL, f"{DIRECTORY} is no absolute path", named)
    # What others may have made there is not used: _check
    shared = "/dev/shm"  # nosec B108
    return Path(named or f"{shared}/bt_actions-{os.geteuid()}")


def _boot_time() -> float:
    """Return seconds that only a start of the machine sets back."""
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if clock is None else time.clock_gettime(clock)


def _check(directory: Path) -> None:
    """Raise OSError where others could have put something into it."""
    seen = directory.lstat()
    if not stat.S_ISDIR(seen.st_mode):
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(directory))
    if seen.st_uid != os.geteuid() or seen.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(errno.EPERM, "others may write there", str(directory))


def _author(path: Path) -> Author | None:
    """Return whose file it is; None: nobody's of ours."""
    try:
        prefix = bytes.fromhex(path.name.removesuffix(_SUFFIX))
    except ValueError:
        return None
    return author_of(prefix + bytes(4)) if len(prefix) == _PREFIX else None


def _read(path: Path) -> bytes:
    """Return what is in a plain file, up to what is ever written; b"" where it has gone."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return b""
        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        return b""
    try:
        return os.pread(file, LENGTH * ROWS_AT_MOST, 0)
    finally:
        os.close(file)


def _parse_all(path: Path, author: Author) -> tuple[list[Sent], bool]:
    """Return what is in a file, and whether anything else is."""
    text = _read(path)
    rows = (text[start : start + LENGTH] for start in range(0, len(text), LENGTH))
    found = [_parse(path, author, row, text) for row, text in enumerate(rows) if text.strip()]
    return [sent for sent in found if sent is not None], None in found


def _parse(path: Path, author: Author, row: int, text: bytes) -> Sent | None:
    try:
        entry = json.loads(text)
        goal_id, action, domain = bytes.fromhex(entry["goal"]), entry["action"], entry["domain"]
        servers = frozenset(bytes.fromhex(each) for each in entry["servers"])
        lost, at, accept = entry["lost"], float(entry["at"]), float(entry["accept"])
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None
    if author_of(goal_id) != author:
        return None
    if not isinstance(action, str) or not _NAME.fullmatch(action) or len(action) > _NAME_AT_MOST:
        return None
    if type(domain) is not int or type(lost) is not bool:
        return None
    if not (0.0 <= accept <= ACCEPT_LONGEST and 0.0 <= at < float("inf")):
        return None
    return Sent(goal_id, action, domain, servers, accept, lost, at, author, path, row)


def _tidy(directory: Path) -> None:
    """Remove files of the dead with nothing in them, and what nobody has wanted for long."""
    with contextlib.suppress(OSError), os.scandir(directory) as entries:
        for entry in itertools.islice(entries, TIDIED_AT_MOST):
            path = Path(entry.path)
            author = _author(path) if path.name.endswith(_SUFFIX) else None
            if author is None or (author.here and author.alive):
                continue
            with contextlib.suppress(OSError):
                (left, damaged), now = _parse_all(path, author), _boot_time()
                if author.here and not damaged and all(sent.at <= now for sent in left):
                    is_over = all(now - sent.at > KEPT_FOR for sent in left)  # also if none is
                else:  # its clock is another one, or unknown
                    is_over = time.time() - path.lstat().st_mtime > KEPT_FOR
                if is_over:
                    path.unlink()
