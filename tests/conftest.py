"""What tests with real rclpy share: a domain of their own, a node, and servers in other processes.

Nothing of ROS is imported before a test asks for it, so the other tests stay fast.
"""

from __future__ import annotations

import contextlib
import faulthandler
import fcntl
import gc
import itertools
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.support.middleware import on_loopback

if TYPE_CHECKING:
    from bt_actions.behaviours.action import ActionBehaviour
    from tests.support.processes import Host, HostFactory, Journal, Process
    from tests.support.virtual import World

DOMAINS = range(70, 90)
OUR_OWN = [f"bt_actions-{name}" for name in ("alarm", "log", "receive", "rediscovery", "rest")]
"""Threads that outlive what they were started for, and end by themselves or with the process."""
_names, _directories = itertools.count(1), itertools.count(1)
STUCK = 900.0
"""Seconds after which a test hangs where no Python runs any more, nor pytest's own timeout:
with several participants in one process Fast DDS was seen not to return from destroying a node."""
_STDERR = pytest.StashKey[int]()


LEFT_OUT = "rclpy is left out by --without-ros"


class WithoutRclpy:
    """A finder of modules that knows no rclpy."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        if name == "rclpy":
            raise ModuleNotFoundError(LEFT_OUT)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--without-ros",
        action="store_true",
        help="run what needs no ROS, with rclpy blocked: who imports it all the same fails",
    )


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """With --without-ros, pass over a file of tests that imports rclpy."""
    report = yield
    if report.failed and LEFT_OUT in str(report.longrepr):
        report.outcome, report.longrepr, report.result = "passed", None, []
    return report


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With --without-ros, leave out the tests that are given a ROS domain, or are marked."""
    if config.option.without_ros:
        needs = [item for item in items if "domain" in item.fixturenames or _is_marked(item)]
        config.hook.pytest_deselected(items=needs)
        items[:] = [item for item in items if item not in set(needs)]


def _is_marked(item: pytest.Item) -> bool:
    return item.get_closest_marker("ros") is not None


def pytest_configure(config: pytest.Config) -> None:
    if config.option.without_ros:
        sys.meta_path.insert(0, WithoutRclpy())  # type: ignore[arg-type]
    assert sys.__stderr__ is not None
    config.stash[_STDERR] = os.dup(sys.__stderr__.fileno())  # the real one, while none is captured


def pytest_make_parametrize_id(val: object) -> str | None:
    """Call a signal by its name, and not by its number, in the names of tests."""
    return val.name if isinstance(val, signal.Signals) else None


def pytest_collection_finish() -> None:
    """Take what pytest knows of all tests out of each garbage collection, which stops everybody."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def _all_records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ledger")


@pytest.fixture(autouse=True)
def _records(_all_records: Path) -> Iterator[None]:
    """What a test's programs send and nobody answers is no other test's (recovery/ledger.py), nor
    are the runs that they record.

    With a patch of its own: the test's has to be undone before what other fixtures have patched.
    """
    with pytest.MonkeyPatch.context() as patch:
        place = _all_records / str(next(_directories))
        patch.setenv("BT_ACTIONS_LEDGER", str(place))
        patch.setenv("XDG_STATE_HOME", str(place.with_suffix(".state")))
        yield


@pytest.fixture(scope="module", autouse=True)
def _little_to_collect() -> None:
    """Begin without what the tests before have left: to collect it stops all threads again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """End the process, telling where each thread is, when a test hangs for good."""
    faulthandler.dump_traceback_later(STUCK, exit=True, file=item.config.stash[_STDERR])
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.fixture(scope="session", autouse=True)
def _not_deaf_to_signals() -> None:
    """Undo what `nohup` and a shell's `&` hand down to all processes that the tests start."""
    for number, handler in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
        (signal.SIGQUIT, signal.SIG_DFL),
    ):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


@pytest.fixture(scope="session")
def domain() -> Iterator[int]:
    """A ROS domain that no other test worker on this machine uses at this time."""
    with contextlib.ExitStack() as stack:
        for number in DOMAINS:
            path = Path(tempfile.gettempdir()) / f"bt_actions-test-domain-{number}"
            claim = stack.enter_context(path.open("w"))
            try:
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            environment = {
                "ROS_DOMAIN_ID": str(number),
                **on_loopback(short_lease=True),  # as what they play, the orchestrator, has it
            }
            before = {name: os.environ.get(name) for name in environment}
            os.environ.update(environment)
            yield number
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
            return
        raise RuntimeError("all ROS domains for tests are taken")


@pytest.fixture(scope="session")
def context(domain: int) -> Iterator[Any]:
    """A context of the tests' own; it outlives them, because discovery takes its time."""
    from rclpy.context import Context

    context = Context()
    context.init(domain_id=domain)
    yield context
    context.shutdown()


@pytest.fixture(scope="session")
def session_node(context: Any) -> Iterator[Any]:
    """A node that nobody spins; TreeRunners borrow it."""
    from rclpy.node import Node

    node = Node("tests", context=context)
    yield node
    node.destroy_node()


@pytest.fixture(scope="session")
def session_host(
    domain: int, session_node: Any, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Host]:
    """A process of servers that lives as long as the tests: never to be killed."""
    from tests.support.processes import Host

    host = Host(tmp_path_factory.mktemp("journals"))
    yield host
    host.close()


@pytest.fixture
def host(session_host: Host, no_leaks: None) -> Host:
    """The shared process of servers."""
    return session_host


@pytest.fixture
def node(session_node: Any, no_leaks: None) -> Any:
    """The shared node."""
    return session_node


@pytest.fixture
def new_host(domain: int, tmp_path: Path, no_leaks: None) -> Iterator[HostFactory]:
    """Start processes of servers that may be killed; their leases are short unless asked for."""
    from tests.support.processes import Host

    hosts: list[Host] = []

    def start(*, short_lease: bool = True, **more: Any) -> Host:
        hosts.append(Host(tmp_path, short_lease=short_lease, **more))
        return hosts[-1]

    yield start
    for each in hosts:
        each.close()


@pytest.fixture
def start_program(domain: int, no_leaks: None) -> Iterator[Callable[..., Process]]:
    """Start a Python program as a process of its own."""
    from tests.support.processes import Process

    processes: list[Process] = []

    def start(*arguments: str, **more: Any) -> Process:
        processes.append(Process(arguments, **more))
        return processes[-1]

    yield start
    for each in processes:
        each.close()


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    """A network of the test's own, in virtual time."""
    from tests.support.virtual import World

    world = World(tmp_path)
    yield world
    world.close()


@pytest.fixture
def name() -> str:
    """The name of an action that no other test uses."""
    return f"/t{os.getpid()}_{next(_names)}/move"


@pytest.fixture
def serve(host: Host, name: str) -> Iterator[Callable[..., Journal]]:
    """Open the server of this test, with faults; it is closed in the end."""
    opened: list[str] = []

    def serve(*faults: str, name: str = name, **script: Any) -> Journal:
        opened.append(name)
        return host.open(name, *faults, **script)

    yield serve
    for each in opened:
        host.close_server(each)


@pytest.fixture
def no_leaks(domain: int) -> Iterator[None]:
    """Fail a test that leaves a thread, an open goal or a resource behind.

    Goals of servers that are gone stay open on purpose, in case the server returns.
    """
    from bt_actions.ros.host import host as process
    from tests.support.waiting import until

    def open_goals() -> list[Any]:
        with process.lock:
            endpoints = [endpoint for each in process.domains.values() for endpoint in each.open]
            goals = [handle.goal for each in endpoints for handle in each.goals.values()]
        return [goal for goal in goals if not goal.lost]

    def threads() -> set[threading.Thread]:
        return {t for t in threading.enumerate() if t.name not in OUR_OWN}

    before = threads()
    yield
    until(lambda: not open_goals(), 8.0, what="no goal is open any more")
    until(lambda: not len(process.domain(domain).resources), what="no resource is held any more")
    try:
        until(lambda: threads() <= before)
    except AssertionError:
        raise AssertionError(f"these threads are left: {threads() - before}") from None


@pytest.fixture(params=["multi", pytest.param("single", marks=pytest.mark.chaos)])
def executor(request: pytest.FixtureRequest) -> str:
    """Both executors; the second in `make chaos` only."""
    return str(request.param)


@pytest.fixture
def run(node: Any) -> Callable[..., ActionBehaviour]:
    """Run a tree on the shared node to its end; returns its root."""
    from bt_actions import TreeRunner

    def run(root: Any, *, executor: str = "multi", timeout: float = 15.0) -> Any:
        with TreeRunner(root, node=node, executor=executor) as runner:
            runner.run(timeout=timeout)
        return root

    return run
