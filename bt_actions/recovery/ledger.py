"""What this process has sent and no server has answered yet, on record should it be killed. No ROS.

A server shows the goals that it has accepted. Of one that it has received, and has not decided on
yet, nobody knows but the sender, and a sender that is killed tells nobody; the robot moves later.
So each goal without an answer has a file, named by its id, which tells its process (goals/ids.py).
It outlives that process, and cleanup reads it (recovery/sweep.py). It lies in memory
(/dev/shm), so that writing it waits for no disk, in a directory that only this user may write to.

It is written before the goal is sent, and removed when that has been answered; not where its server
went away, which may only stand still. What is read is believed no further than that a question
about a goal is worth asking.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import stat
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from bt_actions.goals.ids import Author, author_of
from bt_actions.traffic.host import Entry, Record

DIRECTORY = "BT_ACTIONS_LEDGER"
"""The environment variable that names another directory: one that outlives a container, say."""
LENGTH = 1024
"""Bytes of a file, so that it is replaced in place: the longest action name has 255."""
SERVERS_AT_MOST = 8
"""Servers of a goal on record; where there are more, none is."""
KEPT_FOR = 86400.0
"""Seconds after which a file is removed that nobody has cleaned up."""
_SUFFIX = ".goal"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent(Entry):
    """A goal that a process sent, of whose answer that process knew nothing when it ended."""

    goal_id: bytes
    author: Author
    """Who is dead, or not `here`."""
    path: Path

    def strike(self) -> None:
        """It need not be asked for any more; where that fails, it is."""
        with contextlib.suppress(OSError):
            self.path.unlink()

    def mark_lost(self) -> None:
        """Have it on record that its servers are not in sight."""
        with contextlib.suppress(OSError):
            _write(self.path, replace(self, lost=True))


class Ledger(Record):
    """The record of this process. Under its caller's lock; nothing here raises.

    `complain` is called once with why a goal is not on record, should that happen.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        self._complain = complain
        self._complained = False
        self._home: Path | None = None
        self._paths: dict[bytes, str] = {}

    def __contains__(self, goal_id: bytes) -> bool:
        """Whether a goal is on record."""
        return goal_id in self._paths

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        """Put a goal on record that is about to be sent, or what more is known of it."""
        if len(entry.servers) > SERVERS_AT_MOST:
            entry = replace(entry, servers=frozenset())
        try:
            if self._home is None:
                self._home = directory()
                _tidy(self._home)
            path = self._paths[goal_id] = f"{self._home}/{goal_id.hex()}{_SUFFIX}"
            try:
                _write(path, entry, os.O_CREAT)
            except FileNotFoundError:  # who logs out may have all of /dev/shm removed
                directory()
                _write(path, entry, os.O_CREAT)
        except OSError as error:
            if not self._complained:
                self._complained = True
                self._complain(
                    "should this process be killed, goals that no server has answered yet cannot "
                    f"be cleaned up: they cannot be put on record: {error}"
                )

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""
        path = self._paths.pop(goal_id, None)
        if path is not None:
            with contextlib.suppress(OSError):
                os.unlink(path)  # noqa: PTH108 - a Path takes four times as long

    def disown(self) -> None:
        """Let go of all, as the child of a fork: it is the parent's."""
        self._paths.clear()


def left_behind(passed_over: Collection[Path] = ()) -> Iterator[Sent | OSError]:
    """Find what this user's processes have left on record that are dead, or elsewhere.

    Files in `passed_over` are not read. What cannot be read is told by an OSError in its place.
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
        with contextlib.suppress(FileNotFoundError):  # another cleanup was faster
            if path.stat().st_size == 0:
                continue  # killed before it was written, and so before the goal was sent
            try:
                yield _read(path, author)
            except OSError as error:
                yield error


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
    if not stat.S_ISDIR(seen.st_mode):
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(found))
    if seen.st_uid != os.geteuid() or seen.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(errno.EPERM, "others may write there", str(found))
    return found


def _gone_author(path: Path) -> Author | None:
    """Return whose file it is, if it is dead, or elsewhere; None: nobody's of ours."""
    try:
        author = author_of(bytes.fromhex(path.stem))
    except ValueError:
        return None
    return None if author is None or (author.here and author.alive) else author


def _write(path: str | Path, entry: Entry, how: int = 0) -> None:
    plain = {
        "action": entry.action,
        "domain": entry.domain,
        "servers": sorted(each.hex() for each in entry.servers),
        "accept": min(entry.accept, KEPT_FOR),
        "lost": entry.lost,
    }
    text = json.dumps(plain).encode().ljust(LENGTH)
    file = os.open(path, os.O_WRONLY | os.O_CLOEXEC | how, 0o600)
    try:
        if os.write(file, text) < len(text):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    finally:
        os.close(file)


def _read(path: Path, author: Author) -> Sent:
    """Return what is in a file. Raises OSError where it cannot be read, or makes no sense."""
    text = path.read_bytes()
    try:
        entry = json.loads(text)
        is_sound = isinstance(entry["action"], str) and isinstance(entry["domain"], int)
        if not (is_sound and 0.0 <= entry["accept"] <= KEPT_FOR):
            raise ValueError
        entry["servers"] = frozenset(map(bytes.fromhex, entry["servers"]))
        return Sent(goal_id=bytes.fromhex(path.stem), author=author, path=path, **entry)
    except (ValueError, KeyError, TypeError, RecursionError):
        what = "damaged, or of another version (remove it when nothing runs there)"
        raise OSError(errno.EBADMSG, what, str(path)) from None


def _tidy(directory: Path) -> None:
    """Remove what the dead have left and nobody has wanted for long."""
    for path in directory.glob("*" + _SUFFIX):
        with contextlib.suppress(OSError):
            if time.time() - path.lstat().st_mtime > KEPT_FOR and _gone_author(path) is not None:
                path.unlink()
