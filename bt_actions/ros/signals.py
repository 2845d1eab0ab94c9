"""Signals while a runner works on the main thread: they end its trees before the process.

Only Python's own default handlers are replaced, and put back at the end; so are rclpy's, which are
set beneath Python's, and of which Python knows nothing. A main thread in C hears nothing, as in any
program of Python's.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
    uninstall_signal_handlers,
)

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_BITS: dict[int, int] = {
    signal.SIGINT: int(SignalHandlerOptions.SIGINT),
    signal.SIGTERM: int(SignalHandlerOptions.SIGTERM),
}
"""rclpy's options for handlers of these signals; for both, the sum."""

Interrupt = Callable[[bool, bool], bool | None]
_watch: _Watch | None = None


@contextlib.contextmanager
def ended_by_signals(
    interrupt: Interrupt, last_words: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Call `interrupt(again, ends_process)` at a signal; its usual effect comes after the block.

    `again` is True from the second signal on: its sender does not want to wait. `interrupt` returns
    True where the block does not end by itself. From the second signal on KeyboardInterrupt is
    raised in the block then, and from the third on in any case, unless `interrupt` returns None: it
    hurries, and has something to say.

    The usual effect of SIGINT is KeyboardInterrupt; with rclpy's handlers, the shutdown of
    contexts. The others end the process on the spot, without its exit hooks; then `ends_process` is
    True, and `last_words` is called before. Of blocks within each other all hear the signal, and
    the outermost lets it take effect. Outside of the main thread nothing is done, because Python
    handles signals there only.
    """
    global _watch
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    if _watch is not None:
        with _watch.telling(interrupt):
            yield
        return
    watch = _watch = _Watch()
    try:
        watch.put_on()
        with watch.telling(interrupt):
            yield
    finally:
        try:
            if watch.ends_process():
                last_words()
        finally:
            _watch = None
            watch.take_off()
            watch.let_take_effect()


class _Watch:
    """Handlers that take note of signals, in place of the defaults and of rclpy's."""

    def __init__(self) -> None:
        self._received: list[int] = []
        self._interrupts: list[Interrupt] = []
        self._before: dict[int, Any] = {}  # the type of signal.getsignal
        self._rclpys = _rclpys()
        self._is_over = False

    def put_on(self) -> None:
        if self._rclpys:
            uninstall_signal_handlers()
        for number in _ENDING:
            handler = signal.getsignal(number)
            if handler in (signal.SIG_DFL, signal.default_int_handler):
                self._before[number] = handler
                signal.signal(number, self._note)

    def take_off(self) -> None:
        """Put all handlers back: SIGINT's last of Python's, as it brings KeyboardInterrupt back."""
        meanwhile = _rclpys()  # handlers of an rclpy.init()
        if meanwhile:
            uninstall_signal_handlers()
        # Over which the program has set one of its own, rclpy counts its own as set for ever.
        self._rclpys = (self._rclpys | meanwhile) & ~_rclpys()
        try:
            self.put_back()
        finally:
            if self._rclpys:  # after Python's, which would be set over them
                install_signal_handlers(SignalHandlerOptions(self._rclpys))

    def put_back(self) -> None:
        for number in reversed(self._before):
            if signal.getsignal(number) == self._note:  # else a newer one is the program's
                signal.signal(number, self._before[number])

    @contextlib.contextmanager
    def telling(self, interrupt: Interrupt) -> Iterator[None]:
        """Tell `interrupt` of signals meanwhile, and of those that came before."""
        self._interrupts.append(interrupt)
        try:
            if self._received:
                interrupt(len(self._received) > 1, self.ends_process())
            yield
        finally:
            self._interrupts.pop()

    def ends_process(self) -> bool:
        """Return whether a received signal ends the process on the spot."""
        return any(self._is_fatal(number) for number in self._received)

    def _is_fatal(self, number: int) -> bool:
        of_rclpy = (self._rclpys | _rclpys()) & _BITS.get(number, 0)
        return self._before.get(number) is signal.SIG_DFL and not of_rclpy

    def let_take_effect(self) -> None:
        """Raise the received signals; KeyboardInterrupt last, after which no other could be."""
        self._is_over = True
        for number in sorted(set(self._received), key=lambda number: number == signal.SIGINT):
            fatal = self._is_fatal(number) and signal.getsignal(number) is signal.SIG_DFL
            signal.raise_signal(number)
            if fatal:  # the first process of a container does not end by it
                os._exit(128 + number)

    def disown(self) -> None:
        """Forget all in the child of a fork: a signal ends the child as usual."""
        self.put_back()
        self._received.clear()
        self._rclpys = 0

    def _note(self, number: int, _frame: object) -> None:
        if self._is_over:  # a handler of the user's calls this one
            signal.signal(number, self._before[number])
            signal.raise_signal(number)
            return
        self._received.append(number)
        again, ends_process = len(self._received) > 1, self.ends_process()
        stuck = [interrupt(again, ends_process) for interrupt in self._interrupts]
        if not stuck or stuck[-1] is None:  # the innermost is where this thread is
            return
        if len(self._received) > 2 or (again and stuck[-1]):
            raise KeyboardInterrupt


def _rclpys() -> int:
    """Return the signals with rclpy's handlers in force, as in `_BITS`."""
    return int(get_current_signal_handlers_options())


def _disown() -> None:
    global _watch
    watch, _watch = _watch, None
    if watch is not None:
        watch.disown()


os.register_at_fork(after_in_child=_disown)
