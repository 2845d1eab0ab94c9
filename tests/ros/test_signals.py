"""Handlers of signals, put on and taken off; what signals do to goals is in scenarios/."""

from __future__ import annotations

import signal
import subprocess
import textwrap
from collections.abc import Callable

import pytest

from tests.support.processes import Process

Start = Callable[..., Process]


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
    start_program: Start,
) -> None:
    process = start_program("-c", textwrap.dedent(CHILD_IN_A_RUN))
    assert process.line(within=30.0) == str(-signal.SIGTERM)


HEAD = """
import contextlib, os, signal, sys, threading
import py_trees, rclpy
from bt_actions import TreeRunner
from bt_actions.ros.signals import ended_by_signals

def itself(number):
    os.kill(os.getpid(), number)

def say(*words):
    print(*words, flush=True)
"""
RCLPY_COMES_WITHIN = """
told = threading.Event()

def interrupt(again, ends_process):
    say(ends_process)
    told.set()

with ended_by_signals(interrupt, lambda: say("last words")):
    rclpy.init()
    itself(signal.SIGTERM)
    told.wait()  # another thread may have got it
say("goes on")
"""
A_HANDLER_COMES_WITHIN = """
with ended_by_signals(lambda *_: False):
    signal.signal(signal.SIGTERM, lambda *_: say("the user's"))
itself(signal.SIGTERM)
say("goes on")
"""
ITS_HANDLER_CALLS_OURS = """
with ended_by_signals(lambda *_: False):
    ours = signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGTERM, lambda *args: (say("the user's"), ours(*args)))
    itself(signal.SIGTERM)
say("goes on")
"""
ONE_OF_OURS_IS_LEFT = """
with ended_by_signals(lambda *_: False):
    ours = signal.getsignal(signal.SIGTERM)
signal.signal(signal.SIGTERM, ours)
itself(signal.SIGTERM)
say("goes on")
"""
A_SHUTDOWN_THAT_BLOCKS = """
class Blocks(py_trees.behaviours.Success):
    def shutdown(self):
        for _ in range(3):
            itself(signal.SIGINT)
        threading.Event().wait()

runner = TreeRunner(Blocks("blocks"))
runner.run()
try:
    runner.shutdown()
except KeyboardInterrupt:
    say("goes on")
"""
A_SIGNAL_THAT_DOES_NOT_END_IT = """
class Ends(py_trees.behaviours.Running):
    def update(self):
        itself(signal.SIGTERM)
        return super().update()

TreeRunner(Ends("ends")).run()
say("goes on")
"""
WORDS_ARE_SAID_TO_THE_END = """
def words():
    for _ in range(3):
        itself(signal.SIGTERM)
    say("last words")

with ended_by_signals(lambda *_: False, words):
    itself(signal.SIGTERM)
"""


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (RCLPY_COMES_WITHIN, ["False", "goes on"]),
        (A_HANDLER_COMES_WITHIN, ["the user's", "goes on"]),
        (ITS_HANDLER_CALLS_OURS, ["the user's"] * 2),
        (ONE_OF_OURS_IS_LEFT, []),
        (A_SHUTDOWN_THAT_BLOCKS, ["goes on"]),
        (WORDS_ARE_SAID_TO_THE_END, ["last words"]),
    ],
    ids=[
        "rclpy within",
        "handler within",
        "chained",
        "left",
        "blocks",
        "words",
    ],
)
def test_a_program_of_the_users(start_program: Start, body: str, said: list[str]) -> None:
    process = start_program("-c", HEAD + body)
    assert process.wait(within=60.0) == (0 if "goes on" in said else -signal.SIGTERM), process
    assert process.lines == said


def test_the_first_process_of_a_container_ends_by_a_signal(start_program: Start) -> None:
    """The kernel does not end it by a signal that it has no handler for."""
    alone = ["unshare", "--map-root-user", "--pid", "--fork"]
    if subprocess.run([*alone, "true"], check=False, capture_output=True).returncode:
        pytest.skip("no process namespace can be made here")
    process = start_program("-c", HEAD + A_SIGNAL_THAT_DOES_NOT_END_IT, prefix=alone)
    assert process.wait(within=60.0) == 128 + signal.SIGTERM, process
    assert process.lines == []
