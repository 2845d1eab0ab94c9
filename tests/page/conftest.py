"""The page's server on a port of its own, over runs of its own; and a browser."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from bt_actions.events import Event
from bt_actions.page import server
from bt_actions.page.guard import LOOPBACK, Place
from bt_actions.page.standing import token
from tests.support import browser as chromium
from tests.support.recordings import Going

ROOT = Path(__file__).parents[2]
SHOWN = "window.page?.shown"
SHIFTS = """
window.shifts = 0;
new PerformanceObserver((list) => { for (const one of list.getEntries()) shifts += one.value; })
  .observe({ type: "layout-shift" });
"""
"""Sums up by how much anything has moved on the page that nobody has asked to."""


class Served:
    """A server that can be stopped, and started again on its port."""

    def __init__(self, place: Place = LOOPBACK, idle: float | None = None) -> None:
        self.port, self.token = 0, ""
        self._place, self._idle = place, idle
        self.start()

    def start(self) -> None:
        opened = server.listen(self.port, self._place)
        self.port = opened.getsockname()[1]
        self._server, self.token = server.server_of(None, self._place, idle=self._idle), token()
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [opened]}, daemon=True
        )
        self._thread.start()

    @property
    def address(self) -> str:
        """What a user opens; more may follow behind a &."""
        return f"http://127.0.0.1:{self.port}/#token={self.token}"

    @property
    def cookie(self) -> str:
        """What a browser sends that has posted the token."""
        return f"bt_actions_{self.port}={self.token}"

    def stop(self) -> None:
        self._server.should_exit = True
        self._thread.join(20.0)
        assert not self.runs

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._thread.is_alive()


Begin = Callable[..., Going]


@pytest.fixture
def served() -> Iterator[Served]:
    one = Served()
    yield one
    one.stop()


@pytest.fixture
def begin() -> Iterator[Begin]:
    """Begin a run that goes on, with the options of its writer."""
    begun: list[Going] = []

    def one(events: list[Event], **options: int) -> Going:
        begun.append(Going(events, **options))
        return begun[-1]

    yield one
    for each in begun:
        each.end()


@pytest.fixture(scope="module")
def window() -> Iterator[chromium.Browser]:
    with chromium.browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What examples/night has recorded, in a simulation in which its last move is aborted."""
    state = tmp_path_factory.mktemp("night")
    command = "run examples/night/night.yaml --sim --speed 20 --fault move_robot:12:abort"
    done = subprocess.run(
        [sys.executable, "-m", "bt_actions.cli", *command.split()],
        cwd=ROOT,
        env={**os.environ, "XDG_STATE_HOME": str(state)},
        capture_output=True,
        text=True,
        timeout=100.0,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    return state


class Page:
    """The page of a server, in the window."""

    def __init__(self, window: chromium.Browser, served: Served) -> None:
        self.window, self.served = window, served
        self.place = f"http://127.0.0.1:{served.port}/"

    def open(self, address: str = "", width: int = 1440) -> chromium.Browser:
        self.window.open(self.place + address, width=width, height=900)
        assert self.window.wait_for(SHOWN)
        return self.window

    def text(self, where: str, words: str) -> str:
        """Wait for words in an element; return its text."""
        found = self.window.page.locator(where)
        expect(found).to_contain_text(words, use_inner_text=True, timeout=10_000.0)
        return found.inner_text()


@pytest.fixture
def page(window: chromium.Browser, served: Served) -> Iterator[Page]:
    """The page; the browser must have had nothing to complain about, nor asked another host."""
    window.complaints()
    shown = Page(window, served)
    window.open(served.address)
    assert window.wait_for("!location.hash.includes('token') && page.is_refused === false")
    yield shown
    asked = window.run("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert asked
    assert [each for each in asked if not each.startswith(shown.place)] == []
    refused = "net::ERR_CONNECTION_REFUSED", "net::ERR_INCOMPLETE_CHUNKED_ENCODING"
    said = [each for each in window.complaints() if not any(word in each for word in refused)]
    assert said == []


@pytest.fixture
def over(night: Path, monkeypatch: pytest.MonkeyPatch, page: Page) -> Page:
    monkeypatch.setenv("XDG_STATE_HOME", str(night))
    return page


class Beating:
    """A run whose process lives: its heartbeat goes on until it is told not to."""

    def __init__(self, run: Going, events: list[Event]) -> None:
        self._run, self._at, self._stopped = run, events[-1].at, threading.Event()
        self._lock = threading.Lock()
        self._seconds = 0.0
        self._thread = threading.Thread(target=self._beat)
        self._thread.start()

    def _beat(self) -> None:
        while not self._stopped.wait(0.2):
            self._seconds += 0.2
            at = self._at
            with self._lock:
                seconds = at.steady + self._seconds
                self._run.writer.beat(seconds, at.wall + self._seconds, at.ros, 0.0)
                self._run.writer.flush()

    def write(self, events: list[Event]) -> None:
        with self._lock:
            self._run.write(events)

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()
