"""Handlers of signals, put on and taken off; what signals do to goals is in scenarios/."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import textwrap
from collections.abc import Callable

import pytest

from bt_actions.ros import signals
from bt_actions.traffic import traffic
from tests.support.processes import Process

Start = Callable[..., Process]


@pytest.mark.parametrize("rclpys", ["NO", "SIGINT", "SIGTERM", "ALL"])
@pytest.mark.parametrize(("before", "times"), [(0, 1), (0, 3), (3, 1)], ids=["one", "3", "a 4th"])
def test_sigint_at_any_moment_is_raised_and_leaves_nothing_behind(
    start_program: Start, rclpys: str, before: int, times: int
) -> None:
    process = start_program("-m", "tests.support.interrupted", rclpys, str(before), str(times))
    assert process.wait(within=60.0) == 0, process
    assert int(process.line("opcodes").split()[0]) > 200  # it has passed through the file


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
import os, signal, sys, threading, time
import py_trees, rclpy
from bt_actions import TreeRunner
from bt_actions.ros import signals
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
ITS_HANDLER_IS_BUSY = """
heard = threading.Semaphore(0)
was_heard = signals._Watch._was_heard
signals._Watch._was_heard = lambda *args: (was_heard(*args), heard.release())

with ended_by_signals(lambda *_: say("ours")):
    signal.signal(signal.SIGTERM, lambda *_: say("the user's"))
    for _ in range(3):
        itself(signal.SIGTERM)
        heard.acquire()
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
ANOTHER_RAISES_BEFORE_ITS_END_BEGINS = """
def users(frame, *_):
    if frame.f_code is signals._Block.__exit__.__code__:
        raise TimeoutError  # as a handler of SIGALRM does

try:
    with ended_by_signals(lambda *_: False):
        sys.settrace(users)
except TimeoutError:
    say("too late")
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
IT_HAS_SOMETHING_TO_SAY = """
with ended_by_signals(lambda *_: None):
    for _ in range(4):
        itself(signal.SIGTERM)
    say("something")
"""
IN_C = """
import ctypes
heard = threading.Semaphore(0)
was_heard = signals._Watch._was_heard
signals._Watch._was_heard = lambda *args: (was_heard(*args), heard.release())
mutex, c = ctypes.create_string_buffer(64), ctypes.CDLL(None)
c.pthread_mutex_lock(mutex)

def until_it_is_in_c():
    address, syscall = hex(ctypes.addressof(mutex)), f"/proc/self/task/{os.getpid()}/syscall"
    while address not in open(syscall).read():
        time.sleep(0.01)
"""
TWO_COME_WHILE_IT_IS_IN_C = f"""{IN_C}
def signals_come():
    until_it_is_in_c()
    itself(signal.SIGTERM)
    heard.acquire()
    itself(signal.SIGTERM)
    ACQUIRE
    c.pthread_mutex_unlock(mutex)

with ended_by_signals(lambda again, ends_process: True):
    threading.Thread(target=signals_come).start()
    try:
        c.pthread_mutex_lock(mutex)
        threading.Event().wait(20.0)
    except KeyboardInterrupt:
        say("does not wait")
"""
ONE_MORE_COMES_IN_THE_LAST_WORDS = f"""{IN_C}
def words():
    signal.pthread_kill(threading.get_ident(), signal.SIGUSR1)
    say("insists" if signals.insists() else "waits")
    itself(signal.SIGTERM)
    while not signals.insists():
        time.sleep(0.01)
    say("insists")

def signals_come():
    until_it_is_in_c()
    for _ in range(3):
        itself(signal.SIGTERM)
        heard.acquire()

signal.signal(signal.SIGUSR1, lambda *_: say("the user's"))
with ended_by_signals(lambda *_: True, words):
    threading.Thread(target=signals_come, daemon=True).start()
    c.pthread_mutex_lock(mutex)
"""


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (RCLPY_COMES_WITHIN, ["False", "goes on"]),
        (A_HANDLER_COMES_WITHIN, ["the user's", "goes on"]),
        (ITS_HANDLER_IS_BUSY, ["the user's"] * 3 + ["goes on"]),
        (ITS_HANDLER_CALLS_OURS, ["the user's"] * 2),
        (ONE_OF_OURS_IS_LEFT, []),
        (ANOTHER_RAISES_BEFORE_ITS_END_BEGINS, ["too late"]),
        (A_SHUTDOWN_THAT_BLOCKS, ["goes on"]),
        (WORDS_ARE_SAID_TO_THE_END, ["last words"]),
        (IT_HAS_SOMETHING_TO_SAY, ["something"]),
        (TWO_COME_WHILE_IT_IS_IN_C.replace("ACQUIRE", "heard.acquire()"), ["does not wait"]),
        (TWO_COME_WHILE_IT_IS_IN_C.replace("ACQUIRE", ""), ["does not wait"]),
    ],
    ids=[
        "rclpy within",
        "handler within",
        "busy",
        "chained",
        "left",
        "raises",
        "blocks",
        "words",
        "said",
        "in C",
        "just now",
    ],
)
def test_a_program_of_the_users(start_program: Start, body: str, said: list[str]) -> None:
    process = start_program("-c", HEAD + body)
    assert process.wait(within=60.0) == (0 if "goes on" in said else -signal.SIGTERM), process
    assert process.lines == said


def test_one_more_signal_is_noticed_by_who_says_the_last_words(start_program: Start) -> None:
    process = start_program("-c", HEAD + ONE_MORE_COMES_IN_THE_LAST_WORDS)
    assert process.wait(within=60.0) == 128 + signal.SIGTERM, process
    assert process.lines == ["waits", "insists"]


def test_nobody_insists_where_nobody_listens_any_more() -> None:
    said: queue.Queue[bool] = queue.Queue()

    def told(_number: int, _heard_at: float) -> None:
        ear.close()
        said.put(ear.has_more(lambda _: True))

    ear = signals._Ear(told)
    try:
        assert not ear.has_more(lambda _: True), "nor on another thread than its own"
        os.write(ear._write, bytes([signal.SIGTERM]))
        assert said.get(timeout=10.0) is False
    finally:
        signal.set_wakeup_fd(-1)


def test_who_closes_the_process_does_not_wait_where_somebody_insists(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hurries: list[Callable[[], bool]] = []
    monkeypatch.setattr(traffic, "_closing", False)
    monkeypatch.setattr(traffic, "drain", lambda _, hurry: hurries.append(hurry))
    traffic.close_process()
    assert not hurries[0]()
    monkeypatch.setattr(traffic, "insists", lambda: True)
    assert hurries[0]()


def test_the_first_process_of_a_container_ends_by_a_signal(start_program: Start) -> None:
    """The kernel does not end it by a signal that it has no handler for."""
    alone = ["unshare", "--map-root-user", "--pid", "--fork"]
    if subprocess.run([*alone, "true"], check=False, capture_output=True).returncode:
        pytest.skip("no process namespace can be made here")
    process = start_program("-c", HEAD + A_SIGNAL_THAT_DOES_NOT_END_IT, prefix=alone)
    assert process.wait(within=60.0) == 128 + signal.SIGTERM, process
    assert process.lines == []
