"""What this process has sent and no server has answered yet, on record should it be killed. No ROS.

A server shows the goals that it has accepted. Of one that it has received, and has not decided on
yet, nobody knows but the sender, and a sender that is killed tells nobody; the robot moves later.
So each process keeps a file of its goals without an answer, which outlives it, and which cleanup
(ros/cleanup.py) reads. It lies in memory (/dev/shm), so that writing it never waits for a disk.

The file is named by the bytes that all goal ids of its process begin with (goal_ids.py). A goal has
a line of fixed length, which is written in place before the goal is sent, and is blank again when
it has been answered: two system calls a goal. A process that ends in good order removes the file.
What is read is believed no further than that a question about a goal is worth asking.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import stat
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from bt_actions.goal_ids import author_of

DIRECTORY = "BT_ACTIONS_LEDGER"
"""The environment variable that names another directory: one that outlives a container, say."""
LENGTH = 1024
"""Bytes of a line: the longest action name has 255."""
LINES_AT_MOST = 4096
"""Goals on record at a time; no more are read, either."""
SERVERS_AT_MOST = 8
"""Servers of a goal on record; where there are more, none is."""
KEPT_FOR = 86400.0
"""Seconds after which a file is removed that nobody has cleaned up."""
_BLANK = b" " * (LENGTH - 1)
_PREFIX = 12
_SUFFIX = ".goals"
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_NAME_AT_MOST = 255


class Untrusted(OSError):
    """The directory is somebody else's, or others may write there."""


@dataclass(frozen=True, slots=True)
class Sent:
    """A goal that a process sent, of whose answer that process knew nothing when it ended."""

    goal_id: bytes
    action: str
    domain: int
    """ROS domain id."""
    servers: frozenset[bytes]
    """GIDs of the servers that were in sight; none where they are not known."""
    lost: bool
    """They had gone, as far as its sender knew; that may be wrong where a link was cut."""
    pid: int
    path: Path
    line: int


class Ledger:
    """This process's file. Under its caller's lock; nothing here raises.

    `complain` is called once with why there is none, should it be so.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        self._complain = complain
        self._file: int | None = None
        self._path = Path()
        self._prefix = b""
        self._failed = False
        self._lines: dict[bytes, int] = {}
        self._blank: list[int] = []

    def __contains__(self, goal_id: bytes) -> bool:
        """Whether a goal is on record."""
        return goal_id in self._lines

    def enter(
        self,
        goal_id: bytes,
        action: str,
        domain: int,
        servers: Collection[bytes],
        *,
        lost: bool = False,
    ) -> None:
        """Put a goal on record that is about to be sent, or what more is known of it."""
        if goal_id[:_PREFIX] != self._prefix:
            self._open(goal_id[:_PREFIX])
        if self._file is None:
            return
        line = self._lines.get(goal_id)
        if line is None:
            line = self._blank.pop() if self._blank else len(self._lines)
            if line >= LINES_AT_MOST:
                return
        known = sorted(each.hex() for each in servers) if len(servers) <= SERVERS_AT_MOST else []
        entry = {
            "goal": goal_id.hex(),
            "domain": domain,
            "action": action,
            "servers": known,
            "lost": lost,
        }
        text = json.dumps(entry).encode().ljust(LENGTH - 1) + b"\n"
        self._lines[goal_id] = line
        try:
            if len(text) > LENGTH or os.pwrite(self._file, text, line * LENGTH) < LENGTH:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            self.strike(goal_id)
            self._fail(error)

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""
        line = self._lines.pop(goal_id, None)
        if line is None or self._file is None:
            return
        self._blank.append(line)
        try:
            os.pwrite(self._file, _BLANK, line * LENGTH)
        except OSError as error:
            self._fail(error)

    def close(self) -> None:
        """Remove the file, where nothing is on record; the next goal opens another."""
        if self._file is None or self._lines:
            return
        with contextlib.suppress(OSError):
            self._path.unlink()
        self.disown()

    def disown(self) -> None:
        """Let go of the file, as the child of a fork: it is the parent's."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                os.close(self._file)
        self._file, self._prefix = None, b""
        self._lines, self._blank = {}, []

    def _open(self, prefix: bytes) -> None:
        self.disown()
        self._prefix = prefix
        try:
            directory = _directory()
            directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            _check(directory)
            _remove_what_is_over(directory)
            self._path = directory / (prefix.hex() + _SUFFIX)
            how = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
            self._file = os.open(self._path, how, 0o600)
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        if not self._failed:
            self._failed = True
            self._complain(
                "should this process be killed, goals that no server has answered yet cannot be "
                f"cleaned up: they cannot be put on record: {error}"
            )


def left_behind(passed_over: Collection[Path] = ()) -> Iterator[tuple[Path, list[Sent]]]:
    """Find the files of processes of this machine and user that are dead, and what is in them.

    Those in `passed_over` are not read. What is damaged is skipped.
    """
    directory = _directory()
    try:
        _check(directory)
        paths = sorted(directory.glob("*" + _SUFFIX))
    except OSError:
        return
    for path in paths:
        if path not in passed_over and _is_dead(path):
            yield path, _read(path)


def strike(goals: Iterable[Sent]) -> None:
    """Blank the lines of goals that need not be asked for any more; where that fails, they are."""
    by_path: dict[Path, list[int]] = {}
    for sent in goals:
        by_path.setdefault(sent.path, []).append(sent.line)
    for path, lines in by_path.items():
        with contextlib.suppress(OSError):
            file = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
            try:
                for line in lines:
                    os.pwrite(file, _BLANK, line * LENGTH)
                is_over = not os.pread(file, LENGTH * LINES_AT_MOST, 0).strip()
            finally:
                os.close(file)
            if is_over:
                path.unlink()


def _directory() -> Path:
    named = os.environ.get(DIRECTORY)
    # What others may have made there is not used: _check
    shared = "/dev/shm"  # nosec B108
    return Path(named or f"{shared}/bt_actions-{os.geteuid()}")


def _check(directory: Path) -> None:
    """Raise OSError where others could have put something into it."""
    seen = directory.lstat()
    if not stat.S_ISDIR(seen.st_mode):
        raise Untrusted(f"{directory} is no directory")
    if seen.st_uid != os.geteuid() or seen.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise Untrusted(f"{directory} is not this user's alone to write in")


def _is_dead(path: Path) -> bool:
    try:
        prefix = bytes.fromhex(path.name.removesuffix(_SUFFIX))
    except ValueError:
        return False
    author = author_of(prefix + bytes(4)) if len(prefix) == _PREFIX else None
    return author is not None and author.here and not author.alive


def _read(path: Path) -> list[Sent]:
    try:
        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                return []
            text = os.pread(file, LENGTH * LINES_AT_MOST, 0)
        finally:
            os.close(file)
    except OSError:
        return []
    lines = (text[start : start + LENGTH] for start in range(0, len(text), LENGTH))
    found = (_parse(path, number, line) for number, line in enumerate(lines) if line.strip())
    return [sent for sent in found if sent is not None]


def _parse(path: Path, number: int, line: bytes) -> Sent | None:
    try:
        entry = json.loads(line)
        goal_id, action, domain = bytes.fromhex(entry["goal"]), entry["action"], entry["domain"]
        servers = frozenset(bytes.fromhex(each) for each in entry["servers"])
        lost = entry["lost"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    author = author_of(goal_id)
    if author is None or goal_id[:_PREFIX].hex() != path.name.removesuffix(_SUFFIX):
        return None
    if not isinstance(action, str) or not _NAME.fullmatch(action) or len(action) > _NAME_AT_MOST:
        return None
    if type(domain) is not int or type(lost) is not bool:
        return None
    return Sent(goal_id, action, domain, servers, lost, author.pid, path, number)


def _remove_what_is_over(directory: Path) -> None:
    """Remove the files of the dead with nothing in them, and what nobody has wanted for long."""
    for path in directory.glob("*" + _SUFFIX):
        with contextlib.suppress(OSError):
            old = time.time() - path.lstat().st_mtime > KEPT_FOR
            if _is_dead(path) and (old or not _read(path)):
                path.unlink()
