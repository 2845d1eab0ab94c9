"""A run on a thread of its own: its future, and whether anybody has heard what became of it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent import futures

from py_trees.common import Status

from bt_actions.utilities.plain_text import raised


class StartedRun:
    """One run."""

    def __init__(self, run: Callable[[], Status], release: Callable[[], None]) -> None:
        """`release` is called on its thread when it is over, before the future tells of it."""
        self._run, self._release = run, release
        self.future = futures.Future[Status]()
        self.future.set_running_or_notify_cancel()
        self.is_heard = False
        """Whether somebody has asked what became of it."""
        self._thread = threading.Thread(target=self._go, name="bt_actions-tree", daemon=True)

    def begin(self) -> None:
        """Begin; raises RuntimeError where there can be no more threads."""
        self._thread.start()

    def _go(self) -> None:
        try:
            status = self._run()
        except BaseException as error:  # noqa: BLE001 - raised again by who waits for it
            self._release()
            self.future.set_exception(error)
        else:
            self._release()
            self.future.set_result(status)

    def tell_unheard(self, tell: Callable[[str], None]) -> None:
        """Tell what it raised, if nobody has asked about it."""
        if not self.is_heard and (error := self.future.exception()):
            tell(f"the tree that was started raised {raised(error)}")
        self.is_heard = True

    def join(self) -> None:
        """Wait for its thread, unless this is it: in a done callback."""
        if self._thread is not threading.current_thread():
            self._thread.join()
