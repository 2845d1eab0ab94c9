"""While a tree runs on the main thread: signals that would end the process end the tree first.

Only handlers that are Python's own defaults are replaced, and they are put back. No ROS.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_ENDING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


@contextmanager
def ended_by_signals(interrupt: Callable[[bool], None]) -> Iterator[None]:
    """Call `interrupt(again)` at a signal, and let it take its usual effect when the block is over.

    `again` is True from the second signal on: who sends it does not want to wait. The usual effect
    of SIGINT is KeyboardInterrupt; the others end the process. Elsewhere than on the main thread
    nothing is done, because Python handles signals there only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        interrupt(len(received) > 1)

    before = {number: signal.getsignal(number) for number in _ENDING}
    ours = [number for number in _ENDING if before[number] in _DEFAULTS]
    for number in ours:
        signal.signal(number, note)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])
        if received:
            signal.raise_signal(received[0])
