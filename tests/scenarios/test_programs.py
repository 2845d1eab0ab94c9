"""Programs of the user's own around our runners: signals, and forks.

Here the runners' calls are on the main thread, and their contexts are their own.
"""

from __future__ import annotations

import signal
import textwrap
import time
from collections.abc import Callable
from typing import Any

import pytest

from tests.support.processes import Host, HostFactory, Process
from tests.support.reliability import Record
from tests.support.waiting import holds_for

Start = Callable[..., Process]

HEAD = """
import os, signal, sys, threading
import py_trees, rclpy
from bt_actions import MoveRobot, Timeouts, TreeRunner
T = Timeouts(server=30.0, cancel=3.0)
name = {name!r}
executing = threading.Event()
def said(event):
    if getattr(event, "state", "") == "EXECUTING":
        sys.stdout.write("executing\\n")  # at once: two runners' threads say it
        executing.set()
"""


@pytest.fixture
def program(start_program: Start, name: str) -> Start:
    """Start a program that knows its action's name."""

    def start(body: str, **more: Any) -> Process:
        return start_program("-c", HEAD.format(name=name) + textwrap.dedent(body), **more)

    return start


LOOP_AFTER_A_RUN = """
    rclpy.init()
    node = rclpy.create_node("user")
    with TreeRunner(MoveRobot("first", 0.1, action_name=name, timeout=T)) as runner:
        runner.run(60.0)
    leaf = MoveRobot("second", 9.0, action_name=name, timeout=T)
    tree = py_trees.trees.BehaviourTree(leaf)
    tree.setup(node=node)
    told = False
    try:
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0.02)
            tree.tick()
            if leaf.progress().state == "EXECUTING" and not told:
                told = True
                print("executing", flush=True)
    finally:
        tree.shutdown()
"""


@pytest.mark.parametrize(
    ("number", "own_handler"),
    [
        (signal.SIGTERM, False),
        pytest.param(signal.SIGTERM, True, marks=pytest.mark.chaos),
        pytest.param(signal.SIGINT, False, marks=pytest.mark.chaos),
    ],
)
def test_rclpys_signal_handlers_are_in_force_again_after_a_run(
    host: Host,
    name: str,
    program: Start,
    number: signal.Signals,
    own_handler: bool,
    record: Record,
) -> None:
    """rclpy.init(), maybe a SIGINT handler, a run, a loop of the user's; a signal in mid-goal"""
    journal = host.open(name)
    own = "rclpy.init()\n    signal.signal(signal.SIGINT, lambda *_: None)"
    body = LOOP_AFTER_A_RUN.replace("rclpy.init()", own) if own_handler else LOOP_AFTER_A_RUN
    process = program(body)
    process.line("executing", within=60.0)
    sent = process.send(number)
    process.wait()
    record.took(time.monotonic() - sent)
    assert journal.ends() == ["succeeded", "canceled"], process
    record.outcome = "canceled, by the loop that rclpy's handler ended"


ON_THE_USERS_CONTEXT = """
    from rclpy.executors import SingleThreadedExecutor
    rclpy.init()
    leaf = MoveRobot("m", 9.0, action_name=name, timeout=T)
    runner = TreeRunner(leaf, executor=SingleThreadedExecutor())
    runner.observe_events(said)
    runner.run()
"""


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGHUP,  # for which rclpy has no handler
        pytest.param(signal.SIGTERM, marks=pytest.mark.chaos),
        pytest.param(signal.SIGINT, marks=pytest.mark.chaos),
    ],
)
def test_a_node_of_its_own_in_the_users_context_ends_its_goals_before_a_signal_takes_effect(
    host: Host, name: str, program: Start, number: signal.Signals, record: Record
) -> None:
    """rclpy.init(), a runner with an executor of the user's and no node; a signal in run()"""
    journal = host.open(name)
    process = program(ON_THE_USERS_CONTEXT)
    process.line("executing", within=60.0)
    sent = process.send(number)
    process.wait()
    record.took(time.monotonic() - sent)
    assert journal.ends() == ["canceled"], process
    record.outcome = "canceled, then the signal takes effect"


TWO_RUNNERS = """
    leaves = [MoveRobot(x, 9.0, action_name=name + x, timeout=T) for x in ("", "_b")]
    runners = [TreeRunner(leaf) for leaf in leaves]
    for runner in runners:
        runner.observe_events(said)
    runners[1].start()
    runners[0].run()
"""


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        pytest.param(signal.SIGHUP, marks=pytest.mark.chaos),
    ],
)
def test_a_signal_that_ends_a_process_ends_the_goals_of_all_its_runners(
    host: Host, name: str, program: Start, number: signal.Signals, record: Record
) -> None:
    """One runner in run() on the main thread, one more that was started; the signal named"""
    journals = [host.open(name), host.open(f"{name}_b")]
    process = program(TWO_RUNNERS)
    for _ in journals:
        process.line("executing", within=60.0)
    sent = process.send(number)
    assert process.wait() == -number
    record.took(time.monotonic() - sent)
    assert [journal.ends() for journal in journals] == [["canceled"]] * 2, process
    record.outcome = "both canceled, then the process ends by the signal"


ONE_RUNNER = """
    leaf = MoveRobot("m", 9.0, action_name=name, timeout=Timeouts(server=30.0, cancel=CANCEL))
    runner = TreeRunner(leaf)
    runner.observe_events(said)
    WHERE
    threading.Event().wait(60.0)
"""
IN_RUN = """
    try:
        runner.run()
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""
IN_SHUTDOWN = """
    with runner:
        runner.start()
        executing.wait()
"""
AT_EXIT = """
    runner.start()
    executing.wait()
    sys.exit()
"""


@pytest.mark.parametrize(
    ("where", "numbers", "cancel"),
    [
        (IN_RUN, [signal.SIGTERM], "0.5"),
        (IN_RUN, [signal.SIGTERM, signal.SIGTERM], "60.0"),
        pytest.param(IN_RUN, [signal.SIGINT, signal.SIGTERM], "60.0", marks=pytest.mark.chaos),
        pytest.param(IN_SHUTDOWN, [signal.SIGTERM], "3.0", marks=pytest.mark.chaos),
        pytest.param(
            IN_SHUTDOWN, [signal.SIGTERM, signal.SIGTERM], "60.0", marks=pytest.mark.chaos
        ),
        pytest.param(AT_EXIT, [signal.SIGTERM], "3.0", marks=pytest.mark.chaos),
    ],
    ids=["run", "run-again", "run-other", "shutdown", "shutdown-again", "exit"],
)
def test_a_goal_that_is_left_running_is_named_before_a_signal_ends_the_process(
    host: Host,
    name: str,
    program: Start,
    where: str,
    numbers: list[signal.Signals],
    cancel: str,
    record: Record,
) -> None:
    """A server that refuses to cancel; SIGTERM in run(), in shutdown() or at exit; one more"""
    journal = host.open(name, "*:reject_cancel")
    process = program(ONE_RUNNER.replace("WHERE", where).replace("CANCEL", cancel))
    process.line("executing", within=60.0)
    if where is not IN_RUN:  # which cancels by itself
        journal.wait_for("cancel_requested")
    process.send(numbers[0])
    for number in numbers[1:]:
        journal.wait_for("cancel_requested", journal.count("cancel_requested") + 1)
        process.send(number)
    assert process.wait() == -signal.SIGTERM
    goal_id = str(journal.wait_for("accepted").goal)
    errors = "\n".join(process.errors)
    assert errors.count("not accounted for: ") == 1, process
    assert goal_id in errors, process
    host.cancel_all(name)
    record.outcome = "named on standard error, then the process ends by the signal"


A_TICK_THAT_TAKES_LONG = """
    leaves = [MoveRobot(x, 9.0, action_name=name + x, timeout=T) for x in ("", "_b")]
    inner = TreeRunner(leaves[1])
    inner.observe_events(said)

    class TakesLong(py_trees.behaviour.Behaviour):
        def update(self):
            if leaves[0].progress().state != "EXECUTING":
                return py_trees.common.Status.RUNNING
            HOW
            return py_trees.common.Status.RUNNING

    every = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=True)
    both = [leaves[0], TakesLong("takes long")]
    runner = TreeRunner(py_trees.composites.Parallel("both", policy=every, children=both))
    runner.run()
"""
RUNS_ANOTHER = "inner.run()"
DOES_NOT_RETURN = "inner.start(); threading.Event().wait()"


@pytest.mark.parametrize(
    ("how", "number"),
    [
        (RUNS_ANOTHER, signal.SIGTERM),
        pytest.param(RUNS_ANOTHER, signal.SIGINT, marks=pytest.mark.chaos),
        (DOES_NOT_RETURN, signal.SIGTERM),
    ],
    ids=["nested", "nested-interrupted", "stuck"],
)
def test_a_signal_ends_all_goals_while_a_tick_takes_long(
    host: Host,
    name: str,
    program: Start,
    how: str,
    number: signal.Signals,
    record: Record,
) -> None:
    """In a tick beside a running goal: another runner's run(), or what never returns"""
    journals = [host.open(name), host.open(f"{name}_b")]
    process = program(A_TICK_THAT_TAKES_LONG.replace("HOW", how))
    process.line("executing", within=60.0)
    process.send(number)
    for journal in journals:
        journal.wait_for("canceled", within=30.0)
    if how is DOES_NOT_RETURN:
        process.send(number)
    assert process.wait() == -number, process
    assert [journal.ends() for journal in journals] == [["canceled"]] * 2, process
    record.outcome = "both canceled, then the process ends; where it is stuck, at a later signal"


A_FORK = """
    leaf = MoveRobot("m", 1.0, action_name=name, timeout=T)
    parent = os.getpid()

    class Forks(py_trees.behaviour.Behaviour):
        def update(self):
            if leaf.progress().feedback is None:
                return py_trees.common.Status.RUNNING
            if os.fork() == 0:
                HOW
            os.wait()  # Fast DDS takes the parent's participant away in a child that ends so
            return py_trees.common.Status.SUCCESS

    every = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=True)
    root = py_trees.composites.Parallel("both", policy=every, children=[leaf, Forks("forks")])
    with TreeRunner(root) as runner:
        runner.run()
"""


@pytest.mark.parametrize(
    "how", ["sys.exit(0)", pytest.param("raise ValueError", marks=pytest.mark.chaos)]
)
def test_a_child_that_ends_leaves_its_parents_goal_alone(
    host: Host, name: str, program: Start, how: str, record: Record
) -> None:
    """A behaviour forks in its tick beside a running goal; the child ends while it runs"""
    journal = host.open(name)
    process = program(A_FORK.replace("HOW", how))
    journal.wait_for("succeeded", within=60.0)
    assert journal.events() == ["received", "accepted", "succeeded"], process
    record.outcome = "SUCCEEDED; the child has canceled nothing"


A_PUBLISHER_IN_MID_GOAL = """
    import time
    from std_msgs.msg import String
    leaf = MoveRobot("m", 9.0, action_name=name, timeout=T)
    runner = TreeRunner(leaf)
    runner.observe_events(said)
    runner.start()
    executing.wait()
    time.sleep(3.0)  # all that it has announced so far is acknowledged
    publisher = runner.node.create_publisher(String, "/news", 1)
    time.sleep(0.2)  # so has that, but nobody has acknowledged it
    print("announced", flush=True)
    print(runner.wait(60.0).name, leaf.outcome, leaf.end, flush=True)
    runner.shutdown()
"""


A_PUBLISHER_WHILE_A_GOAL_IS_MADE = """
    import time
    from std_msgs.msg import String
    from bt_actions import ActionBehaviour
    from robot_control_interfaces.action import MoveRobot as Type

    def goal():
        publisher = runner.node.create_publisher(String, "/news", 1)
        time.sleep(0.2)
        print("announced", flush=True)
        time.sleep(2.0)  # meanwhile it is stopped
        return Type.Goal(distance=1.0)

    leaf = ActionBehaviour("m", Type, name, goal, timeout=T)
    tree = py_trees.composites.Sequence("s", True, [py_trees.timers.Timer("t", 4.0), leaf])
    with TreeRunner(tree) as runner:
        print(runner.run(60.0).name, leaf.outcome, leaf.end, flush=True)
"""


A_PUBLISHER_BETWEEN_TWO_GOALS = """
    import time
    from std_msgs.msg import String
    from bt_actions.ros.host import LINGER

    class News(py_trees.behaviour.Behaviour):
        def update(self):
            global publisher
            publisher = runner.node.create_publisher(String, "/news", 1)
            time.sleep(0.2)
            print("announced", flush=True)
            return py_trees.common.Status.SUCCESS

    class Second(py_trees.behaviour.Behaviour):
        def update(self):  # whoever comes now knows nothing of the time before
            global other
            leaf = MoveRobot("o", 0.1, action_name=name + "_other", timeout=T)
            other = TreeRunner(leaf, name="other")
            return py_trees.common.Status.SUCCESS

    first = MoveRobot("first", 0.2, action_name=name, timeout=T)
    nobody_looks = py_trees.timers.Timer("t", LINGER + 3.0)
    while_it_is_stopped = py_trees.timers.Timer("u", 3.0)
    leaf = MoveRobot("m", 1.0, action_name=name, timeout=T)
    each = [first, nobody_looks, News("n"), while_it_is_stopped, Second("s"), leaf]
    with TreeRunner(py_trees.composites.Sequence("s", True, each)) as runner:
        print(runner.run(90.0).name, leaf.outcome, leaf.end, flush=True)
    other.shutdown()
"""


@pytest.mark.parametrize(
    ("lease", "body"),
    [
        ("stock", A_PUBLISHER_IN_MID_GOAL),
        pytest.param("short", A_PUBLISHER_IN_MID_GOAL, marks=pytest.mark.chaos),
        pytest.param("stock", A_PUBLISHER_WHILE_A_GOAL_IS_MADE, marks=pytest.mark.chaos),
        pytest.param("short", A_PUBLISHER_BETWEEN_TWO_GOALS, marks=pytest.mark.chaos),
        pytest.param("stock", A_PUBLISHER_BETWEEN_TWO_GOALS, marks=pytest.mark.chaos),
    ],
    ids=["stock", "short", "while-a-goal-is-made", "between-two-goals", "between-stock"],
)
def test_who_was_stopped_beyond_its_lease_and_is_not_heard_any_more_finds_another_way(
    new_host: HostFactory,
    name: str,
    program: Start,
    lease: str,
    body: str,
    record: Record,
) -> None:
    """SIGSTOP, just after it has announced a publisher, for twice its lease; SIGCONT"""
    journal = new_host(short_lease=lease == "short").open(name)
    process = program(body, short_lease=True)
    process.line("announced", within=60.0)
    process.send(signal.SIGSTOP)
    holds_for(lambda: True, 6.0)
    process.send(signal.SIGCONT)
    assert process.wait(60.0) == 0, process
    assert "SUCCESS SUCCEEDED SUCCEEDED" in str(process)
    goals = 2 if body is A_PUBLISHER_BETWEEN_TWO_GOALS else 1
    assert journal.events() == goals * ["received", "accepted", "succeeded"]
    record.outcome = "SUCCEEDED, exit code 0"


LOOKS_OUT = """
    def told(event):
        said(event)
        if type(event).__name__ == "GoalChanged" and event.outcome is not None:
            print(event.outcome, event.end, flush=True)
    leaf = MoveRobot("m", 40.0, action_name=name, timeout=T)
    with TreeRunner(leaf) as runner:
        runner.observe_events(told)
        runner.run(60.0)
"""


@pytest.mark.chaos
def test_who_stands_still_itself_looks_out_for_a_server_that_went_away_all_the_same(
    new_host: HostFactory, name: str, program: Start, record: Record
) -> None:
    """SIGSTOP to the server beyond its lease, then to the program for 4 s; SIGCONT to both"""
    host = new_host()
    journal = host.open(name)
    process = program(LOOKS_OUT, short_lease=True)
    process.line("executing", within=60.0)
    journal.wait_for("accepted")
    host.send(signal.SIGSTOP)
    process.line("SERVER_LOST SERVER_GONE", within=20.0)
    process.send(signal.SIGSTOP)
    holds_for(lambda: True, 2.0)
    host.send(signal.SIGCONT)
    holds_for(lambda: True, 2.0)
    process.send(signal.SIGCONT)
    assert process.wait(60.0) == 0, process
    assert process.lines[-1] == "SERVER_LOST CANCELED"
    assert journal.ends() == ["canceled"]
    record.outcome = "SERVER_GONE; back: canceled before the program ends"


RARELY_TICKED = """
    leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(server=SERVER))
    with TreeRunner(leaf, heartbeat=30.0) as runner:
        print(runner.run(60.0).name, leaf.outcome, flush=True)
"""


FIRST_GOAL = """
    leaf = MoveRobot("m", 0.1, action_name=name, timeout=T)
    with TreeRunner(leaf) as runner:
        print(runner.run(60.0).name, leaf.outcome, leaf.end, flush=True)
"""


AFTER_ANOTHER = """
    rclpy.init()
    for number in range(3):
        node = rclpy.create_node(f"n{number}")
        leaf = MoveRobot("m", 0.1, action_name=name, timeout=T)
        with TreeRunner(leaf, node=node) as runner:
            runner.run(60.0)
            print(leaf.outcome, leaf.end, flush=True)
        node.destroy_node()
"""


@pytest.mark.chaos
def test_so_does_the_first_goal_of_a_node_that_is_alone_in_its_context(
    new_host: HostFactory, name: str, program: Start, record: Record
) -> None:
    """Two servers; three nodes one after another in one context, which makes a participant anew"""
    journals = [new_host().open(name) for _ in range(2)]
    process = program(AFTER_ANOTHER)
    assert process.wait(60.0) == 0, process
    assert process.lines == ["SERVER_AMBIGUOUS NEVER_STARTED"] * 3
    assert [journal.count("received") for journal in journals] == [0, 0]
    record.outcome = "SERVER_AMBIGUOUS, and nothing is sent"


@pytest.mark.parametrize("server", [0.7, pytest.param(5.0, marks=pytest.mark.chaos)])
def test_no_deadline_counts_the_second_that_a_process_waits(
    new_host: HostFactory, name: str, program: Start, server: float, record: Record
) -> None:
    """One server; the runner ticks by events alone"""
    journal = new_host().open(name)
    process = program(RARELY_TICKED.replace("SERVER", f"{server}"))
    assert process.wait(60.0) == 0, process
    assert process.lines == ["SUCCESS SUCCEEDED"]
    assert journal.events() == ["received", "accepted", "succeeded"]
    record.outcome = "SUCCEEDED"


@pytest.mark.parametrize("servers", [pytest.param(1, marks=pytest.mark.chaos), 2])
def test_the_first_goal_of_a_process_waits_until_it_has_seen_who_is_there(
    new_host: HostFactory, name: str, program: Start, servers: int, record: Record
) -> None:
    """Each of three new processes begins with a goal, as soon as it can"""
    journals = [new_host().open(name) for _ in range(servers)]
    for _ in range(3):
        process = program(FIRST_GOAL)
        assert process.wait(60.0) == 0, process
        wanted = "SUCCESS SUCCEEDED" if servers == 1 else "FAILURE SERVER_AMBIGUOUS NEVER_STARTED"
        assert wanted in str(process)
    sent = [journal.count("received") for journal in journals]
    assert sent == ([3] if servers == 1 else [0, 0])
    record.outcome = "SUCCEEDED" if servers == 1 else "SERVER_AMBIGUOUS, and nothing is sent"
