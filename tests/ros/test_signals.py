"""Handlers of signals, put on and taken off; what signals do to goals is in scenarios/."""

from __future__ import annotations

import signal
import sys
import textwrap
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

import pytest
from rclpy.signals import (
    SignalHandlerOptions,
    get_current_signal_handlers_options,
    install_signal_handlers,
    uninstall_signal_handlers,
)

from bt_actions.ros import signals
from bt_actions.ros.signals import ended_by_signals
from tests.support.processes import Process


@pytest.fixture
def put_back() -> Iterator[None]:
    options = get_current_signal_handlers_options()
    uninstall_signal_handlers()
    yield
    uninstall_signal_handlers()
    install_signal_handlers(options)


def handlers() -> object:
    ending = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    return [signal.getsignal(number) for number in ending], get_current_signal_handlers_options()


def interrupted_at(opcode: int) -> tuple[bool, bool]:
    """Have SIGINT come at an opcode of signals.py; are there so many, and was it raised?"""
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

    before, raised = sys.gettrace(), False
    sys.settrace(trace)
    try:
        with ended_by_signals(lambda *_: False):
            pass
    except KeyboardInterrupt:
        raised = True
    finally:
        sys.settrace(before)
    return passed >= opcode, raised


@pytest.mark.usefixtures("put_back")
@pytest.mark.parametrize("rclpys", ["NO", "SIGINT", "SIGTERM", "ALL"])
def test_sigint_at_any_moment_is_raised_and_leaves_nothing_behind(rclpys: str) -> None:
    install_signal_handlers(getattr(SignalHandlerOptions, rclpys))
    before, opcode, there = handlers(), 0, True
    while there:
        opcode += 1
        there, raised = interrupted_at(opcode)
        assert (raised, handlers()) == (there, before), opcode
    assert opcode > 200  # it has passed through the file


CHILD_IN_A_RUN = """
    import os, signal
    import py_trees
    from bt_actions import TreeRunner

    class Forks(py_trees.behaviour.Behaviour):
        def update(self):
            read, write = os.pipe()
            child = os.fork()
            if child == 0:
                os.write(write, b"!")
                signal.pause()
                os._exit(0)
            os.read(read, 1)
            os.kill(child, signal.SIGTERM)
            print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
            return py_trees.common.Status.SUCCESS

    TreeRunner(Forks("forks")).run()
"""


def test_a_child_that_is_forked_in_a_run_can_be_ended(
    start_program: Callable[..., Process],
) -> None:
    process = start_program("-c", textwrap.dedent(CHILD_IN_A_RUN))
    assert process.line(within=30.0) == str(-signal.SIGTERM)
