"""While a runner works on the main thread: signals that would end the process end its trees first.

Python's handlers run on the main thread, and not while it is in C; a thread hears signals then.
Only handlers that are Python's own defaults are replaced, and they are put back; so are rclpy's,
which are set beneath Python's, and of which Python knows nothing.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
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

TURN = 0.5
"""Seconds for the main thread to see a signal; after them it seems to be in C."""

Interrupt = Callable[[bool, bool], bool | None]


def ended_by_signals(
    interrupt: Interrupt, last_words: Callable[[], object] = lambda: None
) -> contextlib.AbstractContextManager[None]:
    """Call `interrupt(again, ends_process)` at a signal; its usual effect comes after the block.

    `again` is True from the second signal on: who sends it does not want to wait. `interrupt`
    returns True where the block does not end by itself. From the second signal on KeyboardInterrupt
    is raised in it then, and from the third on in any case, unless it returns None: it hurries, and
    has something to say. Where the main thread is in C both are called on another thread, and the
    process ends with the third signal that it has not seen.

    The usual effect of SIGINT is KeyboardInterrupt; with rclpy's handlers, which contexts are shut
    down. The others end the process on the spot, without its exit hooks; then `ends_process` is
    True, and `last_words` is called before. Of blocks within each other all are told, and the
    outermost lets the signals take effect. Elsewhere than on the main thread nothing is done,
    because Python handles signals there only.
    """
    return _Block(_watched(interrupt, last_words))


class _Block:
    """Enters and leaves by the two steps of a generator; its own frames tell who is at an edge.

    A generator, because a handler of the user's may raise before `__exit__` has begun: then ours
    are taken off when it is collected.
    """

    def __init__(self, steps: Iterator[None]) -> None:
        self._steps = steps

    def __enter__(self) -> None:
        next(self._steps)

    def __exit__(self, *_: object) -> None:
        next(self._steps, None)


_EDGES = (_Block.__enter__.__code__, _Block.__exit__.__code__)


def _is_at_an_edge(frame: FrameType | None) -> bool:
    """Whether a block is being entered or left: what is raised there keeps it from its end."""
    while frame is not None and frame.f_code not in _EDGES:
        frame = frame.f_back
    return frame is not None


def _watched(interrupt: Interrupt, last_words: Callable[[], object]) -> Iterator[None]:
    """Watch for signals from the first step to the second, on the main thread."""
    global _watch
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    if _watch is not None:
        yield from _watch.telling(interrupt)
        return
    watch = _Watch(last_words)
    spoken = False
    try:
        _watch = watch
        watch.put_on()
        yield from watch.telling(interrupt)
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
        self._received: list[int] = []  # changed by the main thread alone
        self._heard: Counter[int] = Counter()  # by the ear's
        self._ear: _Ear | None = None
        self._seen_at = float("-inf")
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
        with contextlib.suppress(RuntimeError, OSError, ValueError):  # threads, or descriptors
            self._ear = _Ear(self._was_heard)

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

    def telling(self, interrupt: Interrupt) -> Iterator[None]:
        """Tell `interrupt` of signals meanwhile, and of those that came before."""
        self._interrupts.append(interrupt)
        try:
            if self._received:
                interrupt(len(self._received) > 1, self.ends_process())
            yield
        finally:
            self._interrupts.pop()

    def insists(self) -> bool:
        """Whether the ear's thread, which calls this, has one more signal to hear."""
        return self._ear is not None and self._ear.has_more(self._minds)

    def _minds(self, number: int) -> bool:
        return bool(signal.getsignal(number) == self._note)

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
            fatal = self._is_fatal(number) and signal.getsignal(number) is signal.SIG_DFL
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

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._is_over:
            self._do_as_before(number, frame)
            return
        self._received.append(number)
        while self._heard[number] > self._received.count(number):
            self._received.append(number)  # Python calls this once for all that have come
        self._seen_at = time.monotonic()
        times, ends_process = len(self._received), self.ends_process()
        stuck = [interrupt(times > 1, ends_process) for interrupt in self._interrupts]
        if not stuck or stuck[-1] is None:  # the innermost is where this thread is
            return
        if (times > 2 or (times > 1 and stuck[-1])) and not _is_at_an_edge(frame):
            raise KeyboardInterrupt

    def _do_as_before(self, number: int, frame: FrameType | None) -> None:
        """Be what was there before: a handler of the user's calls this one, or has kept it here."""
        before = self._before.get(signal.Signals(number), signal.SIG_DFL)
        if callable(before):
            before(number, frame)
        else:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    def _was_heard(self, number: int, heard_at: float) -> None:
        """On the ear's thread: see to a signal that the main thread has not seen in its turn.

        It may be in C for long; or it began to wait there just after the signal had come. Where it
        saw two as one, because the second came before it had seen the first, it is sent one more.
        """
        if self._is_over or not self._minds(number):
            return
        self._heard[number] += 1
        if self._heard[number] <= self._received.count(number):
            return
        if self._seen_at > heard_at - TURN:
            self._heard[number] -= 1  # the new one will be heard
            signal.pthread_kill(threading.main_thread().ident or 0, number)
            return
        missed = list((self._heard - Counter(self._received)).elements())
        numbers = self._received + missed
        for interrupt in list(self._interrupts):
            interrupt(len(numbers) > 1, self._end_process(numbers))
        if len(missed) > 2:
            try:
                self._last_words()
            finally:
                if self._seen_at < heard_at:  # it is in C still
                    os._exit(128 + number)


class _Ear:
    """A thread that hears signals whatever the main thread does, and tells of each in a while."""

    def __init__(self, told: Callable[[int, float], None]) -> None:
        """Begin to listen, unless somebody else does; RuntimeError, OSError, ValueError: not."""
        self._told = told
        self._heard: list[tuple[int, float]] = []  # and not told yet: signal, and when
        self._is_closed = False
        self._read, self._write = os.pipe()
        os.set_blocking(self._write, False)
        self._thread = threading.Thread(target=self._listen, name="bt_actions-signals", daemon=True)
        try:
            self._thread.start()
        except RuntimeError:
            os.close(self._read)
            os.close(self._write)
            raise
        before = signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)
        if before != -1:  # asyncio's, or another
            signal.set_wakeup_fd(before)

    def close(self) -> None:
        """Listen no longer; the thread ends by itself."""
        with contextlib.suppress(OSError, ValueError):  # somebody else's, who has closed it
            now = signal.set_wakeup_fd(-1)
            if now != self._write:
                signal.set_wakeup_fd(now)
        os.close(self._write)

    def disown(self) -> None:
        """In the child of a fork: nobody listens here, and the pipe leads to the parent."""
        self.close()
        os.close(self._read)

    def has_more(self, minded: Callable[[int], bool]) -> bool:
        """Whether this is its thread, and a signal has come that is `minded`, and not told yet."""
        if threading.current_thread() is not self._thread:
            return False
        self._hear(0.0)
        return any(minded(number) for number, _ in self._heard)

    def _hear(self, seconds: float | None) -> None:
        """Wait so long for signals, and take those that have come."""
        poll = select.poll()
        poll.register(self._read, select.POLLIN)
        if not self._is_closed and poll.poll(None if seconds is None else 1000.0 * seconds):
            now = time.monotonic()
            numbers = os.read(self._read, 4096)
            self._is_closed = not numbers
            self._heard += [(number, now) for number in numbers]

    def _listen(self) -> None:
        while True:
            until_told = self._heard[0][1] + TURN - time.monotonic() if self._heard else None
            self._hear(None if until_told is None else max(0.0, until_told))
            if self._is_closed:
                break
            now = time.monotonic()
            while self._heard and now - self._heard[0][1] >= TURN:
                self._told(*self._heard.pop(0))
        os.close(self._read)


_watch: _Watch | None = None


def insists() -> bool:
    """Whether one more signal has come since this thread, which hears them, says the last words."""
    watch = _watch
    return watch is not None and watch.insists()


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
