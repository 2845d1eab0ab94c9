"""While a runner works on the main thread: signals that would end the process end its trees first.

Python's handlers run on the main thread, and not while it is in C; a thread hears signals then.
Only handlers that are Python's own defaults are replaced, and they are put back; so are rclpy's,
which are set beneath Python's, and of which Python knows nothing.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from rclpy.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
    uninstall_signal_handlers,
)
from rclpy.utilities import get_default_context

from bt_actions.ros.alive import is_open

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

DEAF_FOR = 1.0
"""Seconds until the main thread, in which a signal was not seen, does not seem to return from C."""

Interrupt = Callable[[bool, bool], bool]


@contextmanager
def ended_by_signals(
    interrupt: Interrupt, last_words: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Call `interrupt(again, ends_process)` at a signal; its usual effect comes after the block.

    `again` is True from the second signal on: who sends it does not want to wait. `interrupt`
    returns True where the block does not end by itself. From the second signal on KeyboardInterrupt
    is raised in it then, and from the third on in any case; where it is in C, the process ends.
    `interrupt` and `last_words` may be called on another thread, too.

    The usual effect of SIGINT is KeyboardInterrupt; with rclpy's handlers, which contexts are shut
    down. The others end the process on the spot, without its exit hooks; then `ends_process` is
    True, and `last_words` is called before. Of blocks within each other all are told, and the
    outermost lets the signals take effect. Elsewhere than on the main thread nothing is done,
    because Python handles signals there only.
    """
    global _watch
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    if _watch is not None:
        with _watch.telling(interrupt):
            yield
        return
    watch = _Watch(last_words)
    spoken = False
    try:
        _watch = watch
        watch.put_on()
        with watch.telling(interrupt):
            yield
    finally:
        try:
            if spoken := watch.ends_process():
                last_words()
        finally:
            _watch = None
            try:
                watch.take_off()
                if watch.ends_process() and not spoken:  # it came in between
                    last_words()
            finally:
                watch.let_take_effect()


class _Watch:
    """Handlers that take note of signals, in place of the defaults and of rclpy's."""

    def __init__(self, last_words: Callable[[], object]) -> None:
        self._last_words = last_words
        self._received: list[int] = []
        self._ear: _Ear | None = None
        self._heard: list[int] = []
        self._heard_since = 0.0
        self._interrupts: list[Interrupt] = []
        self._before: dict[signal.Signals, Any] = {}  # what signal.getsignal returns
        self._rclpys = _rclpys()
        self._had_context = is_open(get_default_context())
        self._is_over = False

    def put_on(self) -> None:
        if self._rclpys:
            uninstall_signal_handlers()
        for number in _ENDING:
            handler = signal.getsignal(number)
            if handler in _DEFAULTS:
                self._before[number] = handler
                signal.signal(number, self._note)
        with contextlib.suppress(RuntimeError, OSError):  # no more threads, no more descriptors
            self._ear = _Ear(self._hear)

    def take_off(self) -> None:
        """Put all back: SIGINT's handler at the end, because KeyboardInterrupt is back with it.

        But rclpy's come after Python's, which would be set over them.
        """
        if self._ear is not None:
            self._ear.close()
        if self._had_context and not is_open(get_default_context()):
            self._rclpys = frozenset()  # rclpy.shutdown() would have taken them off
        meanwhile = _rclpys()  # what an rclpy.init() has put on
        if meanwhile:
            uninstall_signal_handlers()
        # Over which the program has set one of its own, rclpy counts its own as set for ever.
        self._rclpys = (self._rclpys | meanwhile) - _rclpys()
        try:
            for number in reversed(self._before):
                self._put_back(number)
            self._put_back_rclpys()
        finally:
            self._put_back_rclpys()  # where the first time was interrupted

    def _put_back(self, number: signal.Signals) -> None:
        if signal.getsignal(number) == self._note:  # else the program has set its own since
            signal.signal(number, self._before[number])

    def _put_back_rclpys(self) -> None:
        if self._rclpys:
            install_signal_handlers(_OPTIONS[self._rclpys])

    @contextmanager
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
        """Whether what was received ends the process on the spot."""
        return self._end_process(self._received)

    def _end_process(self, numbers: list[int]) -> bool:
        return any(self._is_fatal(number) for number in numbers)

    def _is_fatal(self, number: int) -> bool:
        of_rclpy = self._rclpys | _rclpys()
        return self._before.get(signal.Signals(number)) is signal.SIG_DFL and number not in of_rclpy

    def let_take_effect(self) -> None:
        """Raise what was received; KeyboardInterrupt last, after which nothing could be."""
        self._is_over = True
        for number in sorted(set(self._received), key=lambda number: number == signal.SIGINT):
            fatal = self._is_fatal(number)
            signal.raise_signal(number)
            if fatal:  # the first process of a container does not end by it
                os._exit(128 + number)

    def disown(self) -> None:
        """In the child of a fork: it ends as if this had never been."""
        if self._ear is not None:
            self._ear.disown()
            self._ear = None
        for number in self._before:
            self._put_back(number)
        self._before.clear()
        self._received.clear()
        self._interrupts = [_nothing for _ in self._interrupts]  # each is still taken off
        self._rclpys = frozenset()

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if self._is_over:  # a handler of the user's has raised while this was taken off
            self._put_back(signal.Signals(number))
            signal.raise_signal(number)
            return
        self._received.append(number)
        times, ends_process = len(self._received), self.ends_process()
        stuck = [interrupt(times > 1, ends_process) for interrupt in self._interrupts]
        if times > 2 or (times > 1 and any(stuck[-1:])):  # the innermost is where this thread is
            raise KeyboardInterrupt

    def _hear(self, number: int) -> None:
        """Take note of a signal on the ear's thread: the main thread may be in C."""
        if number not in self._before or self._is_over:
            return
        now = time.monotonic()
        self._heard_since = self._heard_since or now
        self._heard.append(number)
        ends_process = self._end_process(self._heard)
        for interrupt in list(self._interrupts):
            interrupt(len(self._heard) > 1, ends_process)
        deaf = not self._received and now - self._heard_since > DEAF_FOR
        if deaf and len(self._heard) > 2:
            self._last_words()
            os._exit(128 + number)


class _Ear:
    """A thread that hears signals whatever the main thread does."""

    def __init__(self, heard: Callable[[int], None]) -> None:
        """Begin to listen, unless somebody else does; raises RuntimeError or OSError."""
        self._heard = heard
        self._read, self._write = os.pipe()
        try:
            os.set_blocking(self._write, False)
            threading.Thread(target=self._listen, name="bt_actions-signals", daemon=True).start()
        except RuntimeError:
            os.close(self._read)
            os.close(self._write)
            raise
        before = signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)
        if before != -1:  # asyncio's, or another
            signal.set_wakeup_fd(before)

    def close(self) -> None:
        """Listen no longer; the thread ends by itself."""
        self._leave()
        os.close(self._write)

    def disown(self) -> None:
        """In the child of a fork: nobody listens here, and the pipe leads to the parent."""
        self.close()
        os.close(self._read)

    def _leave(self) -> None:
        now = signal.set_wakeup_fd(-1)
        if now != self._write:
            signal.set_wakeup_fd(now)

    def _listen(self) -> None:
        while numbers := os.read(self._read, 4096):
            for number in numbers:
                self._heard(number)
        os.close(self._read)


_watch: _Watch | None = None


def _nothing(_again: bool, _ends_process: bool) -> bool:
    return False


def _rclpys() -> frozenset[signal.Signals]:
    """For which signals rclpy's handlers are in force."""
    now = get_current_signal_handlers_options()
    return next(numbers for numbers, options in _OPTIONS.items() if options == now)


def _disown() -> None:
    global _watch
    watch, _watch = _watch, None
    if watch is not None:
        watch.disown()


os.register_at_fork(after_in_child=_disown)
