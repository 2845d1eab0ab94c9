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
_OPTIONS = {
    frozenset({signal.SIGINT, signal.SIGTERM}): SignalHandlerOptions.ALL,
    frozenset({signal.SIGINT}): SignalHandlerOptions.SIGINT,
    frozenset({signal.SIGTERM}): SignalHandlerOptions.SIGTERM,
    frozenset[signal.Signals](): SignalHandlerOptions.NO,
}
"""What rclpy calls its handlers for these signals."""


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
        if had_contexts and not rclpy.ok():
            theirs = frozenset()  # rclpy.shutdown() would have taken them off
        theirs |= _take_off()  # and what an rclpy.init() has put on meanwhile
        first = received[0] if received else 0
        try:
            if first and before[first] is signal.SIG_DFL and first not in theirs:
                last_words(lambda: len(received) > 1)
        finally:
            for number in ours:
                signal.signal(number, before[number])
            if theirs:
                install_signal_handlers(_OPTIONS[theirs])
            if first:
                signal.raise_signal(first)


def _take_off() -> frozenset[signal.Signals]:
    """Take rclpy's handlers off, and return for which signals they were in force.

    Where a program has set one of its own over rclpy's, rclpy counts its own as set for ever.
    """
    before = _rclpys()
    if before:
        uninstall_signal_handlers()
    return before - _rclpys()


def _rclpys() -> frozenset[signal.Signals]:
    now = get_current_signal_handlers_options()
    return next(numbers for numbers, options in _OPTIONS.items() if options == now)
