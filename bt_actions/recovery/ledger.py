"""The ledger: the record of goals without an answer yet, for the case of a killed process. No ROS.

A server shows the goals that it has accepted. Only the sender knows of a goal that the server has
received, and has not decided on yet. A killed sender tells nobody, and the robot moves later. So
each process has a file, named by the beginning of its goals' ids (ids.py), with a slot for each
goal without an answer. The file outlives a killed process, and cleanup reads it
(recovery/sweep.py). The file lies in memory (/dev/shm), in a directory that only this user may
write to, and is mapped: a system call for each goal would give Python's lock away.

A slot is written before the goal is sent, and blanked when the request has been answered. The slot
stays where the server went away, because that server may only stand still. A record proves no more
than that a question about a goal is worth asking.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import json
import mmap
import os
import stat
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from bt_actions.traffic.state import Entry, Record
from bt_actions.utilities.ids import Author, author_of

DIRECTORY = "BT_ACTIONS_LEDGER"
"""The environment variable that names another directory: one that outlives a container, say."""
LENGTH = 1024
"""Bytes of a slot; the longest action name has 255."""
SERVERS_AT_MOST = 8
"""Servers of a goal on record; of a goal with more of them none is."""
KEPT_FOR = 86400.0
"""Seconds after which a file is removed that no cleanup has read."""
_TOUCHED_EVERY = 1.0
"""Seconds between two looks at the file: a write to a map leaves the file's time alone, and
succeeds though the file was removed."""
_MORE = 16 * LENGTH
_SUFFIX = ".goals"
_BLANK = b"\0"
"""The first byte of a slot that does not count: blank, or while it is written."""
_AUTHOR = 12
"""Bytes of a goal's id that name its process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent(Entry):
    """A goal that a process sent, and whose answer that process did not know when it ended."""

    goal_id: bytes
    author: Author
    """The process, which is dead, or not `here`."""
    path: Path
    at: int
    """The offset of its slot in the file."""

    def strike(self) -> None:
        """Take the goal off the record.

        Where the file cannot be written, a later cleanup asks again.
        """
        self._write(_BLANK)
        with contextlib.suppress(OSError):
            if _is_blank(self.path):
                self.path.unlink()

    def mark_lost(self) -> None:
        """Put on record that the goal's servers are not in sight."""
        self._write(_slot(self.goal_id, replace(self, lost=True)))

    def _write(self, text: bytes) -> None:
        with contextlib.suppress(OSError), self.path.open("r+b") as file:
            os.pwrite(file.fileno(), text, self.at)


class Ledger(Record):
    """The record of this process. The caller holds a lock; nothing here raises.

    `complain` gets, once, the reason why a goal is not on record.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        self._complain = complain
        self._complained = False
        self._path = Path()
        self._file: int | None = None
        self._map: mmap.mmap | None = None
        self._touched_at = 0.0
        self._slots: dict[bytes, int] = {}
        self._free: list[int] = []

    def __contains__(self, goal_id: bytes) -> bool:
        """Return whether a goal is on record."""
        return goal_id in self._slots

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        """Put a goal on record before its request is sent, or update its facts on record."""
        if len(entry.servers) > SERVERS_AT_MOST:
            entry = replace(entry, servers=frozenset())
        try:
            self._touch()
            if self._map is None or not self._free:
                self._map = self._grown(goal_id)
            before, at = self._slots.get(goal_id), self._free.pop()
            self._slots[goal_id], slot = at, _slot(goal_id, entry)
            self._map[at + 1 : at + LENGTH] = slot[1:]
            self._map[at] = slot[0]
            if before is not None:
                self._blank(before)
        except OSError as error:
            if not self._complained:
                self._complained = True
                self._complain(
                    "should this process be killed, goals that no server has answered yet cannot "
                    f"be cleaned up: they cannot be put on record: {error}"
                )

    def _touch(self) -> None:
        now = time.time()
        if self._file is not None and now - self._touched_at > _TOUCHED_EVERY:
            self._touched_at = now
            if os.fstat(self._file).st_nlink:
                os.utime(self._file)
            else:  # a logout may have removed all of /dev/shm
                self.disown()

    def _grown(self, goal_id: bytes) -> mmap.mmap:
        if self._file is None:
            home = directory()
            _tidy(home)
            self._path = home / (goal_id[:_AUTHOR].hex() + _SUFFIX)
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        size = os.fstat(self._file).st_size
        os.posix_fallocate(self._file, size, _MORE)  # where there is no room, a map would crash
        self._free = [*range(size, size + _MORE, LENGTH)][::-1]
        return mmap.mmap(self._file, size + _MORE)

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""
        if (at := self._slots.pop(goal_id, None)) is not None:
            self._blank(at)

    def _blank(self, at: int) -> None:
        assert self._map is not None
        self._map[at] = 0
        self._free.append(at)

    def close(self) -> None:
        """Remove the file, as the process ends, unless there is a goal on it."""
        with contextlib.suppress(OSError):
            if self._file is not None and _is_blank(self._path):
                self._path.unlink()
        self.disown()

    def disown(self) -> None:
        """Close the map in the child of a fork: the file is the parent's."""
        if self._file is not None:
            os.close(self._file)
        self._file = self._map = None
        self._slots.clear()
        self._free.clear()


def left_behind(passed_over: Collection[Path] = ()) -> Iterator[Sent | OSError]:
    """Find the goals on record of this user's processes that are dead, or elsewhere.

    Files in `passed_over` are not read. An unreadable file yields an OSError.
    """
    try:
        home = directory(make=False)
        paths = sorted(home.glob("*" + _SUFFIX))
    except FileNotFoundError:
        return
    except OSError as error:
        yield error
        return
    for path in paths:
        author = None if path in passed_over else _gone_author(path)
        if author is None:
            continue
        try:
            text = path.read_bytes()
        except FileNotFoundError:  # another cleanup was faster
            continue
        except OSError as error:
            yield error
            continue
        for at in range(0, len(text), LENGTH):
            if text[at]:
                yield _read(text[at : at + LENGTH], author, path, at)


def directory(*, make: bool = True) -> Path:
    """Return the directory of the records.

    Raises OSError where the path depends on the current directory, or where others could write.
    """
    named = os.environ.get(DIRECTORY)
    if named and not Path(named).is_absolute():
        raise OSError(errno.EINVAL, f"{DIRECTORY} is no absolute path", named)
    # A directory that others made there is not used, as the check below shows
    shared = "/dev/shm"  # nosec B108
    found = Path(named or f"{shared}/bt_actions-{os.geteuid()}")
    if make:
        found.mkdir(mode=0o700, parents=True, exist_ok=True)
    seen = found.lstat()
    is_ours = stat.S_ISDIR(seen.st_mode) and seen.st_uid == os.geteuid()
    if not is_ours or seen.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(errno.EPERM, "others may write there, or it is no folder", str(found))
    return found


def _gone_author(path: Path) -> Author | None:
    """Return the author of a file, if dead or elsewhere; None for all other files."""
    try:
        author = author_of(bytes.fromhex(path.stem).ljust(16, b"\0"))
    except ValueError:
        return None
    return None if author is None or (author.here and author.alive) else author


def _slot(goal_id: bytes, entry: Entry) -> bytes:
    """Return the content of a slot, in JSON."""
    return f'{{"goal": "{goal_id.hex()}", {_written(entry)[1:]}'.encode().ljust(LENGTH)


@functools.lru_cache(maxsize=64)  # most goals of one action differ in their ids alone
def _written(entry: Entry) -> str:
    plain = {
        "action": entry.action,
        "domain": entry.domain,
        "servers": sorted(each.hex() for each in entry.servers),
        "accept": min(entry.accept, KEPT_FOR),
        "lost": entry.lost,
    }
    return json.dumps(plain)


def _read(slot: bytes, author: Author, path: Path, at: int) -> Sent | OSError:
    """Return the goal in a slot, or an error for a slot that makes no sense."""
    try:
        entry = json.loads(slot)
        goal_id = bytes.fromhex(entry.pop("goal"))
        is_sound = isinstance(entry["action"], str) and isinstance(entry["domain"], int)
        if not (is_sound and 0.0 <= entry["accept"] <= KEPT_FOR and author_of(goal_id) == author):
            raise ValueError
        entry["servers"] = frozenset(map(bytes.fromhex, entry["servers"]))
        return Sent(goal_id=goal_id, author=author, path=path, at=at, **entry)
    except (AttributeError, ValueError, KeyError, TypeError, RecursionError):
        what = "damaged, or of another version (remove it when nothing runs there)"
        return OSError(errno.EBADMSG, what, str(path))


def _is_blank(path: Path) -> bool:
    return not any(path.read_bytes()[::LENGTH])


def _tidy(directory: Path) -> None:
    """Remove files of dead processes that are old, or have no goal on them."""
    for path in directory.glob("*" + _SUFFIX):
        with contextlib.suppress(OSError):
            is_old = time.time() - path.lstat().st_mtime > KEPT_FOR
            author = _gone_author(path)
            if author is not None and (is_old or (author.here and _is_blank(path))):
                path.unlink()
