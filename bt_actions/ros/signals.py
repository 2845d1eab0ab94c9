"""While a tree runs on the main thread: signals that would end the process end the tree first.

Only handlers that are Python's own defaults are replaced, and they are put back; so are rclpy's,
which are set beneath Python's, and of which Python knows nothing.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import rclpy
from rclpy.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
    uninstall_signal_handlers,
)

_ENDING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)
_RCLPYS: dict[int, tuple[SignalHandlerOptions, ...]] = {
    signal.SIGINT: (SignalHandlerOptions.ALL, SignalHandlerOptions.SIGINT),
    signal.SIGTERM: (SignalHandlerOptions.ALL, SignalHandlerOptions.SIGTERM),
}


@contextmanager
def ended_by_signals(
    interrupt: Callable[[bool], None], last_words: Callable[[Callable[[], bool]], None]
) -> Iterator[None]:
    """Call `interrupt(again)` at a signal, and let it take its usual effect when the block is over.

    `again` is True from the second signal on: who sends it does not want to wait. The usual effect
    of SIGINT is KeyboardInterrupt; with rclpy's handlers, which contexts are shut down. The others
    end the process on the spot, without its exit hooks: then `last_words` is called before, with a
    question that it has to ask again and again, whether there was one more signal. Elsewhere than
    on the main thread nothing is done, because Python handles signals there only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        interrupt(len(received) > 1)

    had_contexts = rclpy.ok()
    theirs = _take_off()
    before = {number: signal.getsignal(number) for number in _ENDING}
    ours = [number for number in _ENDING if before[number] in _DEFAULTS]
    for number in ours:
        signal.signal(number, note)
    try:
        yield
    finally:
        put_on_since = _take_off()  # by an rclpy.init() meanwhile
        if put_on_since != SignalHandlerOptions.NO:
            theirs = put_on_since
        elif had_contexts and not rclpy.ok():
            theirs = SignalHandlerOptions.NO  # rclpy.shutdown() would have taken them off
        first = received[0] if received else 0
        if first and before[first] is signal.SIG_DFL and theirs not in _RCLPYS.get(first, ()):
            last_words(lambda: len(received) > 1)
        for number in ours:
            signal.signal(number, before[number])
        if theirs != SignalHandlerOptions.NO:
            install_signal_handlers(theirs)
        if first:
            signal.raise_signal(first)


def _take_off() -> SignalHandlerOptions:
    """Take rclpy's handlers off, and return which there were."""
    options = get_current_signal_handlers_options()
    if options != SignalHandlerOptions.NO:
        uninstall_signal_handlers()
    return options
