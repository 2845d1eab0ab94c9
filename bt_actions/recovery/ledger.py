"""Goals of this process without an answer yet, on record should it be killed. No ROS.

A server shows the goals that it has accepted. Of one that it has received, and has not decided on
yet, nobody knows but the sender, and a sender that is killed tells nobody; the robot moves later.
So each process has a file, named by what its goals' ids begin with (goals/ids.py), with a slot for
each goal without an answer. The file outlives a process that is killed, and cleanup reads it
(recovery/sweep.py). It lies in memory (/dev/shm), in a directory that only this user may write to,
and is mapped: a call of the system's for each goal would give Python's lock away.

A slot is written before the goal is sent, and blank again when that has been answered; not where
its server went away, which may only stand still. A record proves no more than that a
question about a goal is worth asking.
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

from bt_actions.goals.ids import Author, author_of
from bt_actions.traffic.state import Entry, Record

DIRECTORY = "BT_ACTIONS_LEDGER"
"""The environment variable that names another directory: one that outlives a container, say."""
LENGTH = 1024
"""Bytes of a slot; the longest action name has 255."""
SERVERS_AT_MOST = 8
"""Servers of a goal on record; where there are more, none is."""
KEPT_FOR = 86400.0
"""Seconds after which a file is removed that nobody has cleaned up."""
_TOUCHED_EVERY = 1.0
"""Seconds: what is written to a map does not show in the file's time; nor, that it was removed."""
_MORE = 16 * LENGTH
_SUFFIX = ".goals"
_BLANK = b"\0"
"""A slot begins with it where nothing counts: not yet, while it is written."""
_AUTHOR = 12
"""Bytes of a goal's id that tell its process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent(Entry):
    """A goal that a process sent, of whose answer that process knew nothing when it ended."""

    goal_id: bytes
    author: Author
    """The process, which is dead, or not `here`."""
    path: Path
    at: int
    """Where in the file its slot begins."""

    def strike(self) -> None:
        """Ask no more for this goal; where that cannot be written, it is asked for again."""
        self._write(_BLANK)
        with contextlib.suppress(OSError):
            if _is_blank(self.path):
                self.path.unlink()

    def mark_lost(self) -> None:
        """Have it on record that its servers are not in sight."""
        self._write(_slot(self.goal_id, replace(self, lost=True)))

    def _write(self, text: bytes) -> None:
        with contextlib.suppress(OSError), self.path.open("r+b") as file:
            os.pwrite(file.fileno(), text, self.at)


class Ledger(Record):
    """The record of this process. Under its caller's lock; nothing here raises.

    `complain` is called once with why a goal is not on record, should that happen.
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
        """Put a goal on record that is about to be sent, or what more is known of it."""
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
            else:  # who logs out may have all of /dev/shm removed
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
        """Let go of all, as the child of a fork: it is the parent's."""
        if self._file is not None:
            os.close(self._file)
        self._file = self._map = None
        self._slots.clear()
        self._free.clear()


def left_behind(passed_over: Collection[Path] = ()) -> Iterator[Sent | OSError]:
    """Find what this user's processes have left on record that are dead, or elsewhere.

    Files in `passed_over` are not read. For one that cannot be read an OSError comes.
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
    """Return where the records are.

    Raises OSError where that depends on where one stands, or others could put something into it.
    """
    named = os.environ.get(DIRECTORY)
    if named and not Path(named).is_absolute():
        raise OSError(errno.EINVAL, f"{DIRECTORY} is no absolute path", named)
    # What others may have made there is not used, as is seen below
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
    """Return whose file it is, if it is dead, or elsewhere; None: nobody's of ours."""
    try:
        author = author_of(bytes.fromhex(path.stem).ljust(16, b"\0"))
    except ValueError:
        return None
    return None if author is None or (author.here and author.alive) else author


def _slot(goal_id: bytes, entry: Entry) -> bytes:
    """Return what a slot holds, in JSON."""
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
    """Return what is in a slot, or what to say where it makes no sense."""
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
    """Remove what the dead have left where nobody has wanted it for long, or nothing is on it."""
    for path in directory.glob("*" + _SUFFIX):
        with contextlib.suppress(OSError):
            is_old = time.time() - path.lstat().st_mtime > KEPT_FOR
            author = _gone_author(path)
            if author is not None and (is_old or (author.here and _is_blank(path))):
                path.unlink()
