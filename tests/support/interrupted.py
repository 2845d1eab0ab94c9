"""Have SIGINT arrive at each opcode of ros/signals.py in turn, and look what it leaves behind.

A program of its own: where a trace function raises, CPython 3.11 loses count of its recursion.
It is told for which signals rclpy's handlers are in force, how many come in the block before, and
how many at the opcode; it says how many opcodes there were.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any

from rclpy.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
)

from bt_actions.ros import signals
from bt_actions.ros.signals import ended_by_signals


def handlers() -> object:
    """Return what is in force for the signals that end a process."""
    ending = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    return [signal.getsignal(number) for number in ending], get_current_signal_handlers_options()


def interrupted_at(opcode: int, before: int, times: int) -> tuple[bool, bool, object]:
    """Have SIGINT come at an opcode; are there so many, was it raised, and what is in force then?

    While it is raised: whatever its traceback holds is closed later.
    """
    passed, armed = 0, before == 0

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal passed
        if frame.f_code.co_filename != signals.__file__ or frame.f_code.co_name == "_note":
            return None
        frame.f_trace_opcodes = True
        if event == "opcode" and armed:
            passed += 1
            if passed == opcode:
                sys.settrace(None)
                for _ in range(times):
                    signal.raise_signal(signal.SIGINT)
        return trace

    raised, in_force = False, None
    sys.settrace(trace)
    try:
        with ended_by_signals(lambda *_: False):
            armed = True
            for _ in range(before):
                signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        sys.settrace(None)
        raised, in_force = True, handlers()
    finally:
        sys.settrace(None)
    return passed >= opcode, raised, in_force or handlers()


def main() -> None:
    """Stop at the first opcode after which something is not as it was."""
    sys.setrecursionlimit(100_000)
    rclpys, before, times = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    install_signal_handlers(getattr(SignalHandlerOptions, rclpys))
    at_first, opcode, there = handlers(), 0, True
    while there:
        opcode += 1
        there, raised, in_force = interrupted_at(opcode, before, times)
        assert raised == (there or before > 0), f"swallowed at opcode {opcode}"
        assert in_force == at_first, f"left behind at opcode {opcode}: {in_force}"
    print(opcode - 1, "opcodes", flush=True)


if __name__ == "__main__":
    main()
