"""Processes of `bt-actions`, and robots for them in another process."""

from __future__ import annotations

import itertools
import os
import signal
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions.cli.driving import signals
from tests.support.processes import Host, Journal, Process
from tests.support.terminal import Terminal

_numbers = itertools.count(1)

Start = Callable[..., Process]


@pytest.fixture(autouse=True)
def environment() -> Iterator[None]:
    """Take back what a command called in this process has put in place: variables, handlers."""
    before = dict(os.environ)
    handlers = {number: signal.getsignal(number) for number in signals._ENDING}
    yield
    signals._to_ignore.clear()
    for number, handler in handlers.items():
        signal.signal(number, handler)
    for name in set(os.environ) - set(before):
        del os.environ[name]
    os.environ.update(before)


@pytest.fixture
def start(start_program: Callable[..., Process]) -> Start:
    """Start `bt-actions` with some arguments, as a process of its own."""
    return lambda *arguments: start_program("-m", "bt_actions.cli", *arguments)


@pytest.fixture
def terminal(domain: int) -> Iterator[Callable[..., Terminal]]:
    """Start `bt-actions` with some arguments in a terminal of its own."""
    terminals: list[Terminal] = []

    def start(*arguments: str, **environment: str) -> Terminal:
        terminals.append(Terminal(*arguments, **environment))
        return terminals[-1]

    yield start
    for each in terminals:
        each.close()


@pytest.fixture
def namespace() -> str:
    """A namespace that no other test uses."""
    return f"/cli{os.getpid()}_{next(_numbers)}"


@pytest.fixture
def robot(host: Host, namespace: str) -> Iterator[Callable[..., Journal]]:
    """Open a simulated robot in the shared process of servers, under this test's namespace."""
    opened = False

    def open_robot(*faults: str, **settings: Any) -> Journal:
        nonlocal opened
        opened = True
        return host.robot(namespace, *faults, **settings)

    yield open_robot
    if opened:
        host.close_server(namespace)


@pytest.fixture
def mark(monkeypatch: pytest.MonkeyPatch) -> str:
    """Put a mark into the environment of every process that is started from now on."""
    mark = uuid.uuid4().hex
    monkeypatch.setenv("BT_ACTIONS_TEST_MARK", mark)
    return mark


def marked(mark: str) -> list[int]:
    """Return the ids of all processes but this one that carry `mark`."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


@pytest.fixture
def tree(tmp_path: Path) -> Callable[..., Path]:
    """Write a tree of one action."""

    def write(
        *,
        timeout: str = "{server: 5 s, accept: 3 s, result: 30 s, feedback: 5 s, cancel: 2 s}",
        distance: float = 2.0,
        retry: int = 1,
        server: str = "move_robot",
    ) -> Path:
        path = tmp_path / "one_move.yaml"
        path.write_text(
            f"""\
tree: one_move
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: {server}
    timeout: {timeout}
    retry: {retry}
root:
  sequence: Work
  children:
    - move: To the part
      goal: {{distance: {distance}}}
"""
        )
        return path

    return write
