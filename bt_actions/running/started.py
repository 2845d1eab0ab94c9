"""A run on a thread of its own: its future, and whether anybody has heard what became of it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent import futures

from py_trees.common import Status

from bt_actions.utilities.plain_text import raised


class StartedRun(threading.Thread):
    """One run."""

    def __init__(self, work: Callable[[], Status]) -> None:
        """`work` is called on its thread; the future tells what came of it."""
        super().__init__(name="bt_actions-tree", daemon=True)
        self._work = work
        self.future = futures.Future[Status]()
        self.future.set_running_or_notify_cancel()
        self.is_heard = False
        """Whether somebody has asked what became of it."""

    def run(self) -> None:
        """Do what is to be done on this thread."""
        try:
            status = self._work()
        except BaseException as error:  # noqa: BLE001 - raised again by who waits for it
            self.future.set_exception(error)
        else:
            self.future.set_result(status)

    def tell_unheard(self, tell: Callable[[str], None]) -> None:
        """Tell what it raised, if nobody has asked about it."""
        if not self.is_heard and (error := self.future.exception()):
            tell(f"the tree that was started raised {raised(error)}")
        self.is_heard = True
