"""How long Python's garbage collector has kept all Python threads waiting.

In a program that holds millions of objects a full collection takes half a second and more. To this
process's deadlines it looks as if the process had been stopped, and it is not so: the middleware's
own threads run, and take in what is sent. Judges nothing (servers/stalls.py).
"""

from __future__ import annotations

import contextlib
import gc
import threading
import time

FULL = 2
"""The generation of which a collection looks at every object."""


class Collector:
    """Counts the CPU time of full collections, while it watches.

    CPU time: a process that is stopped in the middle of one stands still all the same. Without a
    lock, as a collection may begin anywhere; at worst one counts twice or not at all.
    """

    def __init__(self) -> None:
        self._took = 0.0
        self._clock: int | None = None  # of the thread that collects at this moment
        self._since = 0.0

    def watch(self) -> None:
        """Count from now on."""
        self._took, self._clock = 0.0, None
        gc.callbacks.append(self._note)

    def unwatch(self) -> None:
        """Count no more."""
        with contextlib.suppress(ValueError):  # in the child of a fork it may not watch
            gc.callbacks.remove(self._note)

    def take(self) -> float:
        """Return the seconds since the last call, also of a collection that has not ended yet.

        Python may go on in another thread before the one that collected can say that it is done.
        """
        clock = self._clock
        if clock is not None:
            self._count(clock)
        took, self._took = self._took, 0.0
        return took

    def _note(self, phase: str, info: dict[str, int]) -> None:
        if info["generation"] < FULL:
            return
        if phase == "start":
            clock = time.pthread_getcpuclockid(threading.get_ident())
            self._since, self._clock = time.clock_gettime(clock), clock
        elif self._clock is not None:
            self._count(self._clock)
            self._clock = None

    def _count(self, clock: int) -> None:
        try:
            now = time.clock_gettime(clock)
        except OSError:  # that thread has gone, or was left behind by a fork
            self._clock = None
            return
        self._took += now - self._since
        self._since = now
