"""Unanswered: a run is gone, and its server has its goal without having accepted it.

No status tells of such a goal; what its sender had on record does (bt_actions/recovery/ledger.py).
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.scenarios.conftest import Launch
from tests.support.processes import HostFactory, Journal, Process
from tests.support.records import on_record
from tests.support.reliability import Record
from tests.support.waiting import until

Serve = Callable[..., Journal]
Tree = Callable[..., Path]

DELAY = 12.0
"""Seconds that a server here takes to accept: longer than all that cleanup waits for otherwise."""


def received(launch: Launch, journal: Journal, path: Path, how: signal.Signals) -> Process:
    """Send a goal, and end the run as soon as its server has it: by SIGINT twice, or SIGKILL."""
    run = launch("run", str(path))
    run.line("sending a goal to")
    journal.wait_for("received")
    run.send(how)
    if how is signal.SIGINT:
        time.sleep(0.5)  # or it would be the same wish
        run.send(how)
    run.wait()
    assert journal.count("accepted") == 0
    return run


def canceled_at_once(journal: Journal) -> None:
    """See that the first goal was canceled within the second in which it is asked again."""
    accepted, canceled = (journal.wait_for(event).t for event in ("accepted", "canceled"))
    assert canceled - accepted < 2.0


@pytest.mark.chaos
@pytest.mark.parametrize(
    "how",
    [
        pytest.param(signal.SIGKILL, id="SIGKILL"),
        pytest.param(signal.SIGINT, id="SIGINT twice"),
    ],
)
def test_cleanup_awaits_what_its_server_has_not_accepted_yet(
    how: signal.Signals, launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """The run ends by the signal named while its server decides for 12 s; then cleanup"""
    journal = serve(f"1:delay_accept={DELAY:g}")
    received(launch, journal, tree(name, distance=90.0), how)
    began = time.monotonic()
    cleanup = launch("cleanup")
    assert cleanup.wait(60.0) == 0, cleanup
    record.took(time.monotonic() - began, DELAY + 5.0)
    assert journal.ends() == ["canceled"]
    canceled_at_once(journal)
    assert [line.split()[-1] for line in cleanup.lines] == ["CANCELED"], cleanup
    assert ", without an answer: waiting for 30 s" in "\n".join(cleanup.errors), cleanup
    again = launch("cleanup")
    assert again.wait() == 0, again
    assert "nothing is left" in "\n".join(again.lines), again
    record.outcome = "awaited, then CANCELED; exit code 0; a second cleanup finds nothing"


def test_cleanup_first_awaits_it_before_the_tree_starts(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGKILL to the run while its server decides for 12 s; then `run --cleanup-first`"""
    journal = serve(f"1:delay_accept={DELAY:g}")
    received(launch, journal, tree(name, distance=90.0), signal.SIGKILL)
    again = launch("run", str(tree(name, distance=0.5)), "--cleanup-first")
    assert again.wait(60.0) == 0, again
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    record.outcome = "the old goal CANCELED, then the new one SUCCEEDED; exit code 0"


@pytest.mark.chaos
def test_cleanup_that_is_stopped_leaves_the_record_to_the_next(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGKILL to the run; cleanup, SIGINT while it waits; and cleanup again"""
    journal = serve(f"1:delay_accept={DELAY:g}")
    received(launch, journal, tree(name, distance=90.0), signal.SIGKILL)
    first = launch("cleanup")
    until(lambda: "without an answer" in "\n".join(first.errors), 20.0, what="it waits")
    first.send(signal.SIGINT)
    assert first.wait() == 3, first
    second = launch("cleanup")
    assert second.wait(60.0) == 0, second
    assert journal.ends() == ["canceled"]
    record.outcome = "the first: exit code 3; the second: CANCELED, exit code 0"


@pytest.mark.chaos
def test_cleanup_gives_up_a_goal_that_its_server_denies_for_good(
    launch: Launch, serve: Serve, tree: Tree, name: str, ledger: Path, record: Record
) -> None:
    """SIGKILL to the run; its server refuses the goal, which nobody hears; then cleanup"""
    journal = serve("1:delay_accept=2", "1:reject")
    received(launch, journal, tree(name, distance=90.0), signal.SIGKILL)
    cleanup = launch("cleanup")
    assert cleanup.wait(90.0) == 0, cleanup
    assert [line.split("  ")[-1] for line in cleanup.lines] == ["denied for 30 s"], cleanup
    assert list(ledger.iterdir()) == []
    record.outcome = "exit code 0 after 30 s"


@pytest.mark.chaos
def test_a_server_that_was_restarted_has_nothing_to_await(
    launch: Launch, new_host: HostFactory, tree: Tree, name: str, ledger: Path, record: Record
) -> None:
    """SIGKILL to the run and to its server, which is started again; then cleanup"""
    host = new_host()
    received(launch, host.open(name, "1:delay_accept=60"), tree(name), signal.SIGKILL)
    host.kill()
    journal = new_host().open(name)
    began = time.monotonic()
    cleanup = launch("cleanup", name)
    assert cleanup.wait(60.0) == 0, cleanup
    record.took(time.monotonic() - began, 15.0)
    assert [line.split("  ")[-1] for line in cleanup.lines] == ["its server is gone"], cleanup
    [left] = ledger.iterdir()
    assert [each["lost"] for each in on_record(left)] == [True]
    assert journal.count("received") == 1
    record.outcome = "its server is gone; exit code 0"


@pytest.mark.chaos
def test_cleanup_looks_for_the_server_of_what_was_not_answered(
    launch: Launch, new_host: HostFactory, tree: Tree, name: str, domain: int, record: Record
) -> None:
    """SIGKILL to the run and to its server; cleanup beside another server; cleanup again"""
    host = new_host()
    received(launch, host.open(name, "1:delay_accept=60"), tree(name), signal.SIGKILL)
    host.kill()
    new_host().open(f"{name}/another")
    cleanup = launch("cleanup")
    assert cleanup.wait(60.0) == 3, cleanup
    assert f"no server of {name} answers" in "\n".join(cleanup.errors), cleanup
    again = launch("cleanup")
    assert again.wait(60.0) == 0, again
    record.outcome = "exit code 3, once: its server is not in sight"


@pytest.mark.chaos
def test_what_a_run_has_given_up_as_lost_is_awaited_when_its_server_is_back(
    launch: Launch, new_host: HostFactory, tree: Tree, name: str, record: Record
) -> None:
    """SIGSTOP to a server that decides, until the run has ended; SIGCONT; then cleanup"""
    host = new_host()
    journal = host.open(name, "1:delay_accept=25")
    path = tree(name, distance=90.0, timeout="{server: 5 s, accept: 60 s, cancel: 3 s}")
    run = launch("run", str(path))
    run.line("sending a goal to")
    journal.wait_for("received")
    host.send(signal.SIGSTOP)
    assert run.wait(60.0) == 1, run
    assert "SERVER_LOST" in "\n".join(run.lines), run
    host.send(signal.SIGCONT)
    cleanup = launch("cleanup", name)
    assert cleanup.wait(90.0) == 0, cleanup
    assert journal.ends() == ["canceled"]
    canceled_at_once(journal)
    record.outcome = "SERVER_LOST; then awaited, and CANCELED; exit code 0"


@pytest.mark.chaos
def test_what_was_known_to_be_lost_is_not_told_again(
    launch: Launch, new_host: HostFactory, tree: Tree, name: str, ledger: Path, record: Record
) -> None:
    """SIGKILL to the server, and when that is told, to the run; cleanup beside another server"""
    host = new_host()
    journal = host.open(name, "1:delay_accept=60")
    timeout = "{server: 5 s, accept: 60 s, result: 60 s, cancel: 3 s}"
    path = tree(
        name, timeout=timeout, retry="{attempts: 2, backoff: 60 s, outcomes: [SERVER_LOST]}"
    )
    run = launch("run", str(path), "--verbose")
    run.line("sending a goal to")
    journal.wait_for("received")
    host.kill()
    run.line("SERVER_LOST", 60.0)
    run.send(signal.SIGKILL)
    run.wait()
    [record_of_run] = ledger.iterdir()
    assert [each["lost"] for each in on_record(record_of_run)] == [True]
    new_host().open(f"{name}/another")
    cleanup = launch("cleanup")
    assert cleanup.wait(60.0) == 0, cleanup
    assert "nothing is left" in "\n".join(cleanup.lines), cleanup
    record.outcome = "nothing is left; exit code 0"
