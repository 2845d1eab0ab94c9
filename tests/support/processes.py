"""Child processes of the tests: action servers that obey, and programs a user might have written.

Every process is started here and ended here, by its own id.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any

from bt_actions.simulation import journal
from bt_actions.simulation.journal import JournalLine
from tests.support.middleware import on_loopback
from tests.support.waiting import until

ROOT = Path(__file__).parents[2]
PATIENCE = 20.0
"""Seconds for a process to start or to answer on a machine that does other work besides."""


class Process:
    """A Python process whose lines on stdout can be waited for."""

    grace = 0.5
    """Seconds that it has to end when its stdin is closed."""

    def __init__(
        self,
        arguments: Sequence[str],
        *,
        short_lease: bool = False,
        prefix: Sequence[str] = (),
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """`prefix` is a command that runs another, as ``ip netns exec NAME`` does.

        Its lease is Fast DDS's own, whatever profile the tests have, unless `short_lease` says so.
        """
        ours = {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
        environment = {**os.environ, **ours, **on_loopback(short_lease=short_lease), **environment}
        self.popen = subprocess.Popen(
            [*prefix, sys.executable, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env=environment,
            start_new_session=True,
        )
        self.pid = self.popen.pid
        self.lines: list[str] = []
        self.errors: list[str] = []
        self._new: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._readers = [
            threading.Thread(target=self._read, args=(self.popen.stdout, True), daemon=True),
            threading.Thread(target=self._read, args=(self.popen.stderr, False), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream: IO[str], is_output: bool) -> None:
        for line in stream:
            (self.lines if is_output else self.errors).append(line.rstrip("\n"))
            if is_output:
                self._new.put(line.rstrip("\n"))
        if is_output:
            self._new.put(None)

    def line(self, wanted: str = "", within: float = PATIENCE) -> str:
        """Return the next line on stdout that contains `wanted`."""
        deadline = time.monotonic() + within
        while True:
            try:
                line = self._new.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f"no line {wanted!r} within {within:g} s: {self}") from None
            if line is None:
                raise AssertionError(f"ended without a line {wanted!r}: {self}")
            if wanted in line:
                return line

    def tell(self, line: str) -> None:
        """Write a line to its stdin."""
        assert self.popen.stdin is not None
        self.popen.stdin.write(line + "\n")
        self.popen.stdin.flush()

    def send(self, number: signal.Signals) -> float:
        """Send a signal; return the moment."""
        self.popen.send_signal(number)
        return time.monotonic()

    def wait(self, within: float = PATIENCE) -> int:
        """Wait for its end and return its exit code."""
        try:
            code = self.popen.wait(within)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"did not end within {within:g} s: {self}") from None
        for reader in self._readers:
            reader.join(5.0)
        return code

    def close(self) -> None:
        """End it, by force where it does not end by itself."""
        with contextlib.suppress(OSError, ValueError):
            assert self.popen.stdin is not None
            self.popen.stdin.close()
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGCONT)
            try:
                self.popen.wait(self.grace)
            except subprocess.TimeoutExpired:
                self.popen.kill()
                self.popen.wait()
        with contextlib.suppress(ProcessLookupError):  # forks of it, which hold its output open
            os.killpg(self.pid, signal.SIGKILL)
        for reader in self._readers:
            reader.join(5.0)
        for stream in (self.popen.stdout, self.popen.stderr):
            assert stream is not None
            stream.close()

    def __str__(self) -> str:
        return "\n".join([f"process {self.pid}", *self.lines[-30:], *self.errors[-60:]])

    __repr__ = __str__  # what pytest shows of an assertion's message


class Journal:
    """What one server has written, read while it writes."""

    def __init__(self, path: Path, server: str) -> None:
        self.path = path
        self.server = server
        self.killed: dict[int, float] = {}

    def __repr__(self) -> str:
        return f"<Journal of {self.server}: {', '.join(self.events())}>"

    def entries(self) -> list[JournalLine]:
        """Return all lines about this server so far."""
        if not self.path.exists():
            return []
        return [entry for entry in journal.read(self.path) if entry.server == self.server]

    def events(self) -> list[str]:
        """Return the events of goals so far, without the steps."""
        return [str(e.event) for e in self.entries() if e.goal and e.event != "step"]

    def count(self, event: str) -> int:
        """Return how often `event` has happened."""
        return sum(entry.event == event for entry in self.entries())

    def wait_for(self, event: str, times: int = 1, within: float = 5.0) -> JournalLine:
        """Wait until `event` has happened so often, and return the last of them."""
        until(lambda: self.count(event) >= times, within, what=f"{event} x{times} in the journal")
        return [entry for entry in self.entries() if entry.event == event][times - 1]

    def ends(self) -> list[str | None]:
        """Return how each goal ended, in the order of their coming."""
        return [None if e is None else str(e) for e in journal.ends(self.entries()).values()]

    @property
    def max_live(self) -> int:
        """How many goals were live at once, at most."""
        return journal.max_live(self.entries(), killed=self.killed)

    @property
    def executed_twice(self) -> list[str]:
        """The goals that were accepted more than once."""
        return [goal for (_, goal), n in journal.executions(self.entries()).items() if n > 1]


class Host(Process):
    """A process of action servers; see serving.py."""

    grace = 5.0

    def __init__(self, directory: Path, *, short_lease: bool = False, **more: Any) -> None:
        """`more` is what Process knows."""
        super().__init__(["-m", "tests.support.serving"], short_lease=short_lease, **more)
        self._directory = directory
        self.line('"ready"')

    def order(self, order: str, **details: Any) -> None:
        """Have something done, and wait until it is."""
        self.tell(json.dumps({"order": order, **details}))
        answer = json.loads(self.line('{"'))
        assert "done" in answer, answer

    def open(self, name: str, *faults: str, **script: Any) -> Journal:
        """Open a server; faults are written without its name: ``1:abort``.

        A goal takes as many seconds as its distance says.
        """
        path = self._directory / f"{name.replace('/', '_')}.jsonl"
        written = [f"{name}:{fault}" for fault in faults]
        self.order("open", name=name, journal=str(path), faults=written, **script)
        return Journal(path, name)

    def robot(self, namespace: str, *faults: str, speed: float = 10.0, **more: Any) -> Journal:
        """Open a simulated robot; the journal is that of its ``move_robot``."""
        name = f"{namespace}/move_robot"
        path = self._directory / f"{namespace.replace('/', '_')}.jsonl"
        written = [f"{name}:{fault}" for fault in faults]
        details = {"journal": str(path), "faults": written, "speed": speed, **more}
        self.order("robot", name=namespace, **details)
        return Journal(path, name)

    def close_server(self, name: str) -> None:
        """Close a server or a robot, gracefully."""
        self.order("close", name=name)

    def freeze(self) -> None:
        """Have it answer nothing, as a server that is too busy; its middleware still listens."""
        self.order("freeze")

    def thaw(self) -> float:
        """Have it go on, with all that came meanwhile; return when."""
        moment = time.monotonic()
        self.order("thaw")
        return moment

    def cancel_all(self, name: str) -> None:
        """Cancel all goals of `name`, as another client."""
        self.order("cancel_all", name=name)

    def kill(self) -> float:
        """Kill it with SIGKILL; return the moment."""
        moment = self.send(signal.SIGKILL)
        self.popen.wait()
        return moment


HostFactory = Callable[..., Host]
