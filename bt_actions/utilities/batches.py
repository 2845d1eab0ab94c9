"""A thread that works in batches on other threads' work: they wake it, and never wait for it."""

from __future__ import annotations

import logging
import threading
import time
import traceback
from collections.abc import Callable

BATCH = 0.05
"""Seconds in which work gathers before a step."""
LONGEST = 0.5
"""Seconds in which the work of a burst gathers."""
BEAT = 1.0
"""Seconds between two steps without work."""


class Batches:
    """A thread that calls `step`, from `start` until `close`.

    `step` gets True at its last call. An exception of a step is logged: others have work for the
    same thread.
    """

    def __init__(
        self, name: str, step: Callable[[bool], None], is_burst: Callable[[], bool] = lambda: False
    ) -> None:
        self._step, self._is_burst = step, is_burst
        self._news = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self.poke = self._news.set
        """Let a step follow soon; on any thread."""

    def start(self) -> None:
        """Begin; not on two threads at once. Later calls do nothing."""
        if self._thread.ident is None:
            self._thread.start()

    def close(self, patience: float) -> None:
        """Finish all work; wait so many seconds at most, as a disk may hang."""
        self._closing = True
        self.poke()
        if self._thread.ident is not None:
            self._thread.join(patience)

    def _work(self) -> None:
        while True:
            last = self._closing
            self._news.clear()
            try:
                self._step(last)
            except Exception:  # noqa: BLE001 - a bug
                name, told = self._thread.name, traceback.format_exc()
                logging.getLogger("bt_actions").error("the thread %s goes on after %s", name, told)
            if last:
                return
            self._news.wait(BEAT)
            until = time.monotonic() + LONGEST
            while not self._closing:
                time.sleep(BATCH)
                if not self._is_burst() or time.monotonic() >= until:
                    break
