"""Have SIGINT arrive at each opcode of ros/signals.py in turn, and look what it leaves behind.

A program of its own: where a trace function raises, CPython 3.11 loses count of its recursion.
It is told for which signals rclpy's handlers are in force, and says how many opcodes there were.
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


def interrupted_at(opcode: int) -> tuple[bool, bool]:
    """Have SIGINT come at an opcode; are there so many, and was it raised?"""
    passed = 0

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal passed
        if frame.f_code.co_filename != signals.__file__:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            passed += 1
            if passed == opcode:
                sys.settrace(None)
                signal.raise_signal(signal.SIGINT)
        return trace

    raised = False
    sys.settrace(trace)
    try:
        with ended_by_signals(lambda *_: False):
            pass
    except KeyboardInterrupt:
        raised = True
    finally:
        sys.settrace(None)
    return passed >= opcode, raised


def main() -> None:
    """Stop at the first opcode after which something is not as it was."""
    sys.setrecursionlimit(100_000)
    install_signal_handlers(getattr(SignalHandlerOptions, sys.argv[1]))
    before, opcode, there = handlers(), 0, True
    while there:
        opcode += 1
        there, raised = interrupted_at(opcode)
        assert raised == there, f"swallowed at opcode {opcode}"
        assert handlers() == before, f"left behind at opcode {opcode}: {handlers()}"
    print(opcode - 1, "opcodes", flush=True)


if __name__ == "__main__":
    main()
