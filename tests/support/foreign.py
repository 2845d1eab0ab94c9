"""Programs as a user writes them, with node, executor and loop: ``python -m … PROGRAM ACTION``.

Each sends a long goal, says "executing" when it runs, and ends in its own way, good or bad. None
of them is kinder to our leaf than py_trees' contract asks for. What a program does, its docstring
tells the report of the scenarios.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import sys
import threading
from collections.abc import Callable
from typing import Any, NoReturn

import py_trees
import rclpy
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor

from bt_actions import MoveRobot, Timeouts, TreeRunner
from bt_actions.events import Event, GoalChanged

PATIENT = Timeouts(cancel=10.0, server=30.0, accept=30.0)
"""Many of these programs start at once."""


class User:
    """A node, a tree of one leaf, and the ways to tick it."""

    def __init__(self, action: str) -> None:
        rclpy.init()
        self.node = rclpy.create_node("user")
        self.leaf = MoveRobot("m", 60.0, action_name=action, timeout=PATIENT)
        self.tree = py_trees.trees.BehaviourTree(self.leaf)
        self.tree.setup(node=self.node)
        self._said = False

    def executing(self) -> bool:
        if self.leaf.progress().state != "EXECUTING":
            return False
        if not self._said:
            self._said = True
            print("executing", flush=True)
        return True

    def tick(self) -> None:
        self.tree.tick()
        self.executing()

    def work(self) -> None:
        """Tick in a loop of its own until the goal runs."""
        while not self.executing():
            rclpy.spin_once(self.node, timeout_sec=0.01)
            self.tree.tick()

    def work_for_ever(self) -> NoReturn:
        while True:
            rclpy.spin_once(self.node, timeout_sec=0.01)
            self.tick()

    def tell(self) -> None:
        print(f"end {self.leaf.outcome} {self.leaf.end}", flush=True)


def shut_down_and_destroy_on_the_next_line(user: User) -> None:
    """shutdown() of the tree, destroy_node() and rclpy.shutdown(), line by line."""
    user.work()
    user.tree.shutdown()
    user.node.destroy_node()
    rclpy.shutdown()
    user.tell()


def destroy_while_another_thread_spins(user: User) -> None:
    """shutdown() of the tree and destroy_node(), while a MultiThreadedExecutor spins."""
    executor = MultiThreadedExecutor(3)
    executor.add_node(user.node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    while not user.executing():
        user.tree.tick()
        threading.Event().wait(0.02)
    user.tree.shutdown()
    user.node.destroy_node()
    user.tell()
    executor.shutdown()
    thread.join()
    rclpy.shutdown()


def _shut_down_in_a_timer(user: User, executor: Any) -> None:
    executor.add_node(user.node)

    def callback() -> None:
        user.tree.tick()
        if user.executing():
            timer.cancel()
            user.tree.shutdown()
            user.tell()
            user.node.destroy_node()
            rclpy.shutdown()

    timer = user.node.create_timer(0.02, callback)
    with contextlib.suppress(ExternalShutdownException):
        executor.spin()


def shut_down_in_a_timer(user: User) -> None:
    """shutdown() of the tree and destroy_node() in a timer of a SingleThreadedExecutor."""
    _shut_down_in_a_timer(user, SingleThreadedExecutor())


def shut_down_in_a_timer_of_a_multithreaded_executor(user: User) -> None:
    """shutdown() of the tree and destroy_node() in a timer of a MultiThreadedExecutor."""
    _shut_down_in_a_timer(user, MultiThreadedExecutor(3))


def tick_tock(user: User) -> None:
    """tick_tock() of the tree until its interrupt(), while a thread spins; then shutdown()."""
    executor = SingleThreadedExecutor()
    executor.add_node(user.node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()

    def enough(tree: py_trees.trees.BehaviourTree) -> None:
        if user.executing():
            tree.interrupt()

    user.tree.tick_tock(period_ms=20, post_tick_handler=enough)
    user.tree.shutdown()
    user.tell()
    executor.shutdown()
    thread.join()
    user.node.destroy_node()
    rclpy.shutdown()


def tick_in_a_timer_until_done(user: User) -> None:
    """Ticks in a timer of a MultiThreadedExecutor; the one that lets the goal succeed."""
    user.leaf.goal = {"distance": 0.3}
    done = rclpy.task.Future()

    def callback() -> None:
        user.tick()
        if user.tree.root.status is not py_trees.common.Status.RUNNING:
            timer.cancel()
            done.set_result(None)

    timer = user.node.create_timer(0.02, callback)
    executor = MultiThreadedExecutor(2)
    executor.add_node(user.node)
    executor.spin_until_future_complete(done)
    user.tree.shutdown()
    user.tell()
    executor.shutdown()
    user.node.destroy_node()
    rclpy.shutdown()


def shut_down_by_the_context(user: User) -> None:
    """shutdown() of the tree by the context's on_shutdown(), which holds its own lock then."""
    user.node.context.on_shutdown(user.tree.shutdown)
    user.work()
    rclpy.shutdown()
    user.tell()
    user.node.destroy_node()


def never_shut_down(user: User) -> None:
    """destroy_node() and rclpy.shutdown(), but never shutdown() of the tree."""
    user.work()
    user.node.destroy_node()
    rclpy.shutdown()


def just_end(user: User) -> None:
    """The program ends in mid-goal; nothing is shut down or destroyed."""
    user.work()


def just_end_soon(user: User) -> None:
    """The program ends in mid-goal, whatever the server says; it refuses to cancel."""
    user.leaf.timeouts = Timeouts(cancel=2.0, server=30.0, accept=30.0)
    user.work()


def end_with_a_spinning_daemon_thread(user: User) -> None:
    """The program ends in mid-goal beside a daemon thread in spin(), for which rclpy may abort."""
    executor = SingleThreadedExecutor()
    executor.add_node(user.node)
    threading.Thread(target=executor.spin, daemon=True).start()
    while not user.executing():
        user.tree.tick()
        threading.Event().wait(0.02)


def crash(user: User) -> None:
    """An exception on the main thread in mid-goal."""
    user.work()
    raise RuntimeError("on purpose")


def crash_in_a_timer(user: User) -> None:
    """An exception in a timer, which ends rclpy.spin() in mid-goal."""

    def callback() -> None:
        user.tree.tick()
        if user.executing():
            raise RuntimeError("on purpose")

    user.node.create_timer(0.02, callback)
    rclpy.spin(user.node)


def exit_in_a_timer(user: User) -> None:
    """sys.exit(7) in a timer, which ends rclpy.spin() in mid-goal."""

    def callback() -> None:
        user.tree.tick()
        if user.executing():
            sys.exit(7)

    user.node.create_timer(0.02, callback)
    rclpy.spin(user.node)


def loop_until_a_signal(user: User) -> None:
    """A loop of spin_once() and tick(), in mid-goal."""
    user.work_for_ever()


def spin_until_a_signal(user: User) -> None:
    """Ticks in a timer, rclpy.spin(), in mid-goal."""
    user.node.create_timer(0.02, user.tick)
    rclpy.spin(user.node)


def spin_until_a_signal_and_clean_up(user: User) -> None:
    """The same, and shutdown(), destroy_node() and try_shutdown() after it."""
    user.node.create_timer(0.02, user.tick)
    try:
        rclpy.spin(user.node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        user.tree.shutdown()
        user.tell()
        user.node.destroy_node()
        rclpy.try_shutdown()


def tick_tock_until_a_signal(user: User) -> None:
    """tick_tock() of the tree while rclpy.ok() and a thread spins, then shutdown()."""
    executor = SingleThreadedExecutor()
    executor.add_node(user.node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()

    def until_the_context_ends(tree: py_trees.trees.BehaviourTree) -> None:
        user.executing()
        if not rclpy.ok():
            tree.interrupt()

    try:  # SIGINT also raises KeyboardInterrupt, wherever the program is
        user.tree.tick_tock(period_ms=20, post_tick_handler=until_the_context_ends)
        user.tree.shutdown()
        user.tell()
    finally:
        thread.join()  # rclpy aborts a process that ends while a thread of its own still spins


def _started(action: str, *, until_it_runs: bool = True) -> TreeRunner:
    """A runner with a node of its own, whose goal runs, or will."""
    leaf = MoveRobot("m", 60.0, action_name=action, timeout=PATIENT)
    runner = TreeRunner(leaf)

    def say(event: Event) -> None:
        if isinstance(event, GoalChanged) and event.state == "EXECUTING":
            print("executing", flush=True)
            executing.set()

    executing = threading.Event()
    runner.observe_events(say)
    runner.start()
    if until_it_runs:
        executing.wait()
    return runner


def crash_beside_a_runner(action: str) -> NoReturn:
    """An exception on the main thread beside a TreeRunner that was started."""
    _started(action)
    raise RuntimeError("on purpose")


def end_beside_a_runner(action: str) -> None:
    """The main thread ends beside a TreeRunner that was started."""
    _started(action)


def wait_for_a_runner(action: str) -> None:
    """start() and wait() of a TreeRunner, in mid-goal."""
    _started(action, until_it_runs=False).wait()


def run_and_clean_up(action: str) -> None:
    """run() of a TreeRunner in a with-block, in mid-goal."""
    leaf = MoveRobot("m", 60.0, action_name=action, timeout=PATIENT)
    with TreeRunner(leaf) as runner:
        runner.observe_events(
            lambda event: (
                print("executing", flush=True)
                if isinstance(event, GoalChanged) and event.state == "EXECUTING"
                else None
            )
        )
        runner.run()


PROGRAMS: dict[str, Callable[..., None]] = {
    name: program
    for name, program in list(globals().items())
    if callable(program) and getattr(program, "__module__", "") == __name__ and name[0].islower()
}


def _end_with_the_test() -> None:
    if not os.read(0, 1):
        os._exit(99)


if __name__ == "__main__":
    threading.Thread(target=_end_with_the_test, daemon=True).start()
    program = PROGRAMS[sys.argv[1]]
    takes_a_user = "user" in inspect.signature(program).parameters
    program(User(sys.argv[2]) if takes_a_user else sys.argv[2])
