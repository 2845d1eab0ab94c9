"""Scenarios: processes that are killed, networks that are cut, and the record of what came of it.

A scenario marked `chaos` runs in `make chaos` only; the others in every `make test`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from bt_actions.goals.attempts import Attempts
from tests.support.processes import Host, Journal, Process
from tests.support.reliability import (
    ON_A_BUSY_MACHINE,
    Record,
    family,
    first_paragraph,
    sentence,
    write,
)

_RECORDS = pytest.StashKey[list[Record]]()
_RECORD = pytest.StashKey[Record]()

Launch = Callable[..., Process]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--reliability", metavar="FILE", help="write the report of the scenarios")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_RECORDS] = []


@pytest.fixture(autouse=True)
def record(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Record]:
    """What this scenario tells the report; it gathers journals and attempts by itself.

    Attempts, and not leaves: those must be free to go when the scenario drops them.
    """
    record = Record(
        family=family(request.module.__doc__),
        scenario=sentence(request.node.name),
        number=request.session.items.index(request.node),
        leniency=1.0 if request.config.getoption("--reliability", None) else ON_A_BUSY_MACHINE,
        did=first_paragraph(request.function.__doc__),
    )
    faults: list[str] = []
    owners: dict[int, list[Journal]] = {}

    def noting(method: Callable[..., Journal]) -> Callable[..., Journal]:
        def opened(host: Host, name: str, *given: str, **more: Any) -> Journal:
            journal = method(host, name, *given, **more)
            faults.extend(given)
            owners.setdefault(host.pid, []).append(journal)
            if journal.path not in [known.path for known in record.journals]:
                record.journals.append(journal)
            return journal

        return opened

    def kill(host: Host) -> float:
        moment = real_kill(host)
        for journal in owners.get(host.pid, []):
            journal.killed[host.pid] = moment
        return moment

    def begin(attempts: Attempts, *given: Any) -> None:
        real_begin(attempts, *given)
        record.visits.append(attempts.history)

    real_kill, real_begin = Host.kill, Attempts.__init__
    monkeypatch.setattr(Attempts, "__init__", begin)
    monkeypatch.setattr(Host, "open", noting(Host.open))
    monkeypatch.setattr(Host, "robot", noting(Host.robot))
    monkeypatch.setattr(Host, "kill", kill)
    request.config.stash[_RECORDS].append(record)
    request.node.stash[_RECORD] = record
    yield record
    if not record.did and faults:
        record.did = "server's fault: " + ", ".join(faults)
    record.read()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    record = item.stash.get(_RECORD, None)
    if record is not None:
        if report.skipped:
            record.verdict = f"skipped: {report.longrepr[2].removeprefix('Skipped: ')}"
        elif report.failed:
            record.verdict = "failed"
        elif report.when == "call":
            record.verdict = "passed"
    return report


def pytest_sessionfinish(session: pytest.Session) -> None:
    path, records = session.config.getoption("--reliability", None), session.config.stash[_RECORDS]
    if path and hasattr(session.config, "workeroutput"):
        session.config.workeroutput["scenarios"] = [record.told() for record in records]
    elif path:
        write(Path(path), sorted(records, key=lambda record: record.number))


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take in what a worker of pytest-xdist has recorded; one that crashed leaves nothing."""
    told = getattr(node, "workeroutput", {}).get("scenarios", [])
    node.config.stash[_RECORDS] += [Record(**each) for each in told]


@pytest.fixture(autouse=True)
def ledger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The records of what is sent (recovery/ledger.py), of this scenario's programs alone."""
    directory = tmp_path / "ledger"
    monkeypatch.setenv("BT_ACTIONS_LEDGER", str(directory))
    return directory


@pytest.fixture
def spin(node: Any) -> Iterator[Callable[[], None]]:
    """Spin the node for a moment, on this thread, as a loop of the user's does."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    yield lambda: executor.spin_once(timeout_sec=0.005)
    executor.shutdown()
    node.executor = None


@pytest.fixture
def launch(domain: int, no_leaks: None) -> Iterator[Launch]:
    """Start `bt-actions` with some arguments as a process of its own; see Process for the rest."""
    processes: list[Process] = []

    def start(
        *arguments: str,
        prefix: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
        program: Sequence[str] = ("-m", "bt_actions.cli"),
    ) -> Process:
        processes.append(
            Process(
                [*program, *arguments],
                short_lease=True,  # as `bt-actions` gives itself where there is no profile
                prefix=prefix,
                environment=environment or {},
            )
        )
        return processes[-1]

    yield start
    for each in processes:
        each.close()


@pytest.fixture
def tree(tmp_path: Path) -> Callable[..., Path]:
    """Write a tree of one move, or of several in a row."""

    def write_tree(
        server: str,
        *,
        distance: float | Sequence[float] = 5.0,
        timeout: str = "{server: 5 s, accept: 3 s, result: 60 s, cancel: 3 s}",
        retry: str = "1",
    ) -> Path:
        distances = [distance] if isinstance(distance, float) else distance
        moves = "\n".join(
            f"    - move: Move {number}\n      goal: {{distance: {each}}}"
            for number, each in enumerate(distances, start=1)
        )
        path = tmp_path / "moves.yaml"
        path.write_text(
            f"""\
tree: moves
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: {server}
    timeout: {timeout}
    retry: {retry}
root:
  sequence: Work
  children:
{moves}
"""
        )
        return path

    return write_tree
