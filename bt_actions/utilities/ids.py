"""Ids that tell which process chose them, so that a killed process' goals can be found. No ROS.

An id has the 16 bytes of a goal's, which is ours to choose: 3 that say "bt_actions", 3 for the
machine (its pid and time namespaces included), 4 for the process id, 2 for the moment that process
started, and 4 that differ within it. An id made elsewhere has the first six bytes by accident once
in 2**48.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import itertools
import os
import secrets
import socket
import threading
from dataclasses import dataclass
from pathlib import Path

MACHINE = "BT_ACTIONS_MACHINE"
"""The environment variable that names this machine, where its own name will not do: a container
that is started again has another pid namespace, and its predecessor's goals would be somebody's."""
_MAGIC = hashlib.sha256(b"bt_actions goal id 1").digest()[:3]
_HIDDEN = b"\0\0"
"""The stand-in for the moment of a start that cannot be read."""
_lock = threading.Lock()
_made_by: tuple[int, bytes, itertools.count[int]] | None = None


@dataclass(frozen=True, slots=True)
class Author:
    """The process that chose an id."""

    here: bool
    """Whether the process ran on this machine, where it can be looked for."""
    pid: int
    started: bytes

    @property
    def alive(self) -> bool:
        """Whether the process still runs; a process elsewhere counts as alive."""
        if not self.here:
            return True
        started = _start_of(self.pid)
        return started == self.started or (
            started is not None and _HIDDEN in (started, self.started)
        )


def new_id() -> bytes:
    """Return an id that carries this process's identity."""
    global _made_by
    pid = os.getpid()
    with _lock:
        if _made_by is None or _made_by[0] != pid:  # the first, or after a fork
            prefix = _MAGIC + _machine() + pid.to_bytes(4, "big") + (_start_of(pid) or _HIDDEN)
            _made_by = (pid, prefix, itertools.count(secrets.randbits(32)))
        return _made_by[1] + (next(_made_by[2]) & 0xFFFFFFFF).to_bytes(4, "big")


def author_of(goal_id: bytes) -> Author | None:
    """Return the author of an id, or None where bt_actions did not make it."""
    if len(goal_id) != 16 or goal_id[:3] != _MAGIC:
        return None
    here = goal_id[3:6] == _machine()
    return Author(here, int.from_bytes(goal_id[6:10], "big"), goal_id[10:12])


def _machine() -> bytes:
    name = os.environ.get(MACHINE) or _name_of_machine(os.getpid())
    return hashlib.sha256(name.encode()).digest()[:3]


@functools.lru_cache(maxsize=1)
def _name_of_machine(_pid: int) -> str:
    """Return a name of this machine for the calling process; a fork may be elsewhere.

    In another time namespace the same process has another moment of its start.
    """
    parts = [socket.gethostname()]
    with contextlib.suppress(OSError):
        parts.append(Path("/etc/machine-id").read_text(encoding="utf-8").strip())
    for kind in ("pid", "time"):
        with contextlib.suppress(OSError):
            parts.append(str(Path("/proc/self/ns", kind).readlink()))
    return "\n".join(parts)


def _start_of(pid: int) -> bytes | None:
    """Return a token of the moment a process started; None for a process that is gone."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:  # no process, a hidden one, or no more files
        return _without_proc(pid)
    fields = stat.rpartition(")")[2].split()
    if fields[0] in "ZX":
        return None  # dead, and not yet reaped
    return hashlib.sha256(fields[19].encode()).digest()[:2]


def _without_proc(pid: int) -> bytes | None:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return None
    except OSError:
        pass  # somebody else's process
    return _HIDDEN
