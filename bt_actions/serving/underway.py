"""The actions that a server's trees use at this moment, on record should it be killed. No ROS.

A server that is started again cleans up these actions before it accepts goals. The record lies in
memory, beside the ledger. A server that ends in good order leaves no file, but for goals whose end
it does not know.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import threading
from collections.abc import Collection, Iterable
from pathlib import Path

from bt_actions.recovery.ledger import directory
from bt_actions.ros.log import log
from bt_actions.utilities.ids import author_of, new_id
from bt_actions.utilities.whole_file import replace_file

_SUFFIX = ".underway"
_PREFIX = 12
"""Bytes that all goal ids of a process begin with."""
_number = itertools.count(1)


class Underway:
    """The record of one server, in the ROS domain `domain`. On any thread; nothing here raises."""

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._lock = threading.Lock()
        self._runs: dict[object, Collection[str]] = {}
        self._path: Path | None = None
        self._name = f"{new_id()[:_PREFIX].hex()}-{next(_number)}{_SUFFIX}"

    def begins(self, run: object, actions: Collection[str]) -> None:
        """Put on record that a run is about to use these actions, by their full names."""
        if actions:
            with self._lock:
                self._runs[run] = actions
                self._write()

    def ends(self, run: object) -> None:
        """Take a run whose goals have all ended off the record."""
        with self._lock:
            if self._runs.pop(run, None) is not None:
                self._write()

    def _write(self) -> None:
        actions = sorted(set(itertools.chain(*self._runs.values())))
        try:
            self._path = self._path or directory() / self._name
            if actions:
                text = json.dumps({"domain": self._domain, "actions": actions})
                replace_file(self._path, text.encode())
            else:
                self._path.unlink(missing_ok=True)
        except OSError as error:
            log.warning(f"no record for cleanup, should this server be killed: {error}")


def left_underway(domain: int) -> Iterable[tuple[Path, list[str]]]:
    """Return the records of killed servers of this machine, in a ROS domain. Raises OSError."""
    for path in sorted(directory().glob(f"*{_SUFFIX}")):
        author = None
        with contextlib.suppress(ValueError):
            prefix = bytes.fromhex(path.name.partition("-")[0])
            author = author_of(prefix[:_PREFIX] + bytes(16 - _PREFIX))
        if author is None or not author.here or author.alive:
            continue
        with contextlib.suppress(ValueError, KeyError, TypeError, FileNotFoundError):
            record = json.loads(path.read_bytes())
            if record["domain"] == domain:
                yield path, [str(each) for each in record["actions"]]
