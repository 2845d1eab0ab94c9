"""The network: orchestrator and servers on two machines, and the link between them.

The machines are two network namespaces that the test makes; only their own traffic is in them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions.ros.environment import PROFILE, SHORT_LEASE
from bt_actions.simulation.journal import ends as journal_ends
from tests.scenarios.conftest import Launch
from tests.support.network import Machines
from tests.support.processes import Host, Journal, Process
from tests.support.reliability import Record
from tests.support.waiting import holds_for, until

Tree = Callable[..., Path]

ON_THE_NETWORK = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # /dev/shm would be a link that nobody can cut
    PROFILE: "",
}
WITH_THE_SHORT_LEASE = {**ON_THE_NETWORK, PROFILE: str(SHORT_LEASE)}
LEASE = 3.0
REMEMBERS = 120.0
"""Seconds for which a server keeps a result: longer than any deadline here, as rclpy's 15 minutes
are. On a link that loses a fifth, a question for one took up to 21 s to arrive."""


class Site:
    """Two machines: servers on b, the orchestrator on a."""

    def __init__(self, machines: Machines, launch: Launch, directory: Path) -> None:
        self.machines = machines
        self._launch = launch
        self._directory = directory
        self.hosts: list[Host] = []

    def serve(self, *faults: str, name: str = "/far/move", short_lease: bool = True) -> Journal:
        """Open a server on b."""
        host = Host(
            self._directory,
            prefix=self.machines.on(self.machines.b),
            environment=WITH_THE_SHORT_LEASE if short_lease else ON_THE_NETWORK,
        )
        self.hosts.append(host)
        return host.open(name, *faults, remembers=REMEMBERS)

    def run(self, tree: Path, *arguments: str) -> Process:
        """Run a tree on a."""
        return self._launch(
            "run",
            str(tree),
            "--json",
            *arguments,
            prefix=self.machines.on(self.machines.a),
            environment=ON_THE_NETWORK,
        )


NewSite = Callable[..., Site]


@pytest.fixture
def site(launch: Launch, tmp_path: Path) -> Iterator[NewSite]:
    """Build the two machines; skip the test where that is not permitted."""
    sites: list[Site] = []

    def build(**quality: float) -> Site:
        try:
            machines = Machines(**quality)
        except OSError as error:
            pytest.skip(f"two network namespaces cannot be made and joined here: {error}")
        sites.append(Site(machines, launch, tmp_path))
        return sites[-1]

    yield build
    for each in sites:
        for host in each.hosts:
            host.close()
        each.machines.close()


def goals(run: Process) -> list[dict[str, Any]]:
    """The last that was said of each goal, in the order of their coming."""
    last: dict[str, dict[str, Any]] = {}
    for line in run.lines:
        event = json.loads(line)
        if event["event"] == "goal":
            last[event["goal_id"]] = event
    return list(last.values())


def stood(run: Process) -> list[tuple[str, str]]:
    return [(goal["outcome"], goal["end"]) for goal in goals(run)]


def executing(run: Process) -> None:
    run.line('"state": "EXECUTING"')


MOVES = """\
tree: network
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: /far/move
    timeout: {timeout}
    retry: {retry}
root:
  fallback: Work
  children:
    - move: First
      goal: {{distance: 9.0}}
    - move: Second
      goal: {{distance: 0.5}}
"""


def first_or_second(directory: Path, timeout: str, retry: str = "1") -> Path:
    """Write a tree: a long move and, where that fails, a short one."""
    path = directory / "network.yaml"
    path.write_text(MOVES.format(timeout=timeout, retry=retry))
    return path


def test_runs_over_a_network(site: NewSite, tree: Tree, record: Record) -> None:
    """Three goals, from one machine to the other"""
    here = site()
    journal = here.serve()
    run = here.run(tree("/far/move", distance=[0.3, 0.2, 0.1]))
    assert run.wait() == 0, run
    assert journal.ends() == ["succeeded"] * 3
    record.outcome = "SUCCEEDED three times, exit code 0"


def test_a_link_that_is_cut_for_1_s(site: NewSite, tree: Tree, record: Record) -> None:
    """The link is cut for 1 s in mid-motion; feedback deadline 3 s"""
    here = site()
    journal = here.serve()
    timeout = "{server: 10 s, accept: 5 s, result: 20 s, feedback: 3 s, cancel: 5 s}"
    run = here.run(tree("/far/move", distance=[3.0, 0.3], timeout=timeout))
    executing(run)
    here.machines.cut()
    assert holds_for(lambda: run.popen.poll() is None, 1.0)
    here.machines.join()
    assert run.wait() == 0, run
    assert journal.ends() == ["succeeded"] * 2
    assert journal.executed_twice == []
    record.outcome = "SUCCEEDED, as if nothing had been"


@pytest.mark.chaos
def test_a_link_that_is_cut_while_a_goal_ends(site: NewSite, tree: Tree, record: Record) -> None:
    """The link is cut for 1.5 s, in which the goal succeeds: its result goes into the dark"""
    here = site()
    journal = here.serve()
    timeout = "{server: 10 s, accept: 5 s, result: 20 s, feedback: 5 s, cancel: 5 s}"
    run = here.run(tree("/far/move", distance=[1.0, 0.3], timeout=timeout))
    executing(run)
    cut = here.machines.cut()
    journal.wait_for("succeeded")
    assert holds_for(lambda: run.popen.poll() is None, max(0.1, cut + 1.5 - time.monotonic()))
    mended = here.machines.join()
    assert run.wait() == 0, run
    record.took(time.monotonic() - mended, 12.0)
    assert journal.ends() == ["succeeded"] * 2
    assert journal.executed_twice == []
    record.outcome = "SUCCEEDED twice, exit code 0"


@pytest.mark.chaos
def test_a_link_that_is_cut_before_the_acceptance(
    site: NewSite, tree: Tree, record: Record
) -> None:
    """The link is cut for 2 s while the server has the goal and has not answered yet"""
    here = site()
    journal = here.serve("1:delay_accept=1")
    timeout = "{server: 10 s, accept: 8 s, result: 20 s, cancel: 5 s}"
    run = here.run(tree("/far/move", distance=[1.0, 0.3], timeout=timeout))
    journal.wait_for("received", within=15.0)
    here.machines.cut()
    assert holds_for(lambda: run.popen.poll() is None, 2.0)
    here.machines.join()
    assert run.wait() == 0, run
    assert journal.ends() == ["succeeded"] * 2
    assert journal.executed_twice == []
    record.outcome = "SUCCEEDED twice, exit code 0"


@pytest.mark.chaos
@pytest.mark.parametrize("short_lease", [True, False], ids=["short_lease", "stock_lease"])
def test_a_link_that_is_cut_for_10_s(
    site: NewSite, tmp_path: Path, short_lease: bool, record: Record
) -> None:
    """Cut for 10 s; then the same server is back with our goal still running"""
    here = site()
    journal = here.serve("1:slow=10", short_lease=short_lease)
    silence = "" if short_lease else "feedback: 2 s, "
    timeout = f"{{queue: 30 s, server: 30 s, accept: 5 s, result: 60 s, {silence}cancel: 2 s}}"
    run = here.run(first_or_second(tmp_path, timeout))
    executing(run)
    cut = here.machines.cut()
    left = run.line('"outcome": "SERVER_LOST"' if short_lease else '"outcome": "STALLED"')
    record.took(time.monotonic() - cut, 6.0)
    assert holds_for(lambda: run.popen.poll() is None, max(0.1, cut + 10.0 - time.monotonic()))
    assert journal.count("cancel_requested") == 0
    here.machines.join()
    assert run.wait(40.0) == 0, run
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1, "the first was canceled before anything else"
    assert journal.executed_twice == []
    record.outcome = f"{json.loads(left)['outcome']}; back: canceled, then the next SUCCEEDED"


@pytest.mark.chaos
def test_a_link_that_is_cut_for_ever(site: NewSite, tree: Tree, record: Record) -> None:
    """The link is cut and stays so; the server has the short lease, the tree no deadline"""
    here = site()
    journal = here.serve()
    run = here.run(tree("/far/move", distance=9.0, timeout="{server: 5 s, cancel: 3 s}"))
    executing(run)
    cut = here.machines.cut()
    assert run.wait() == 1, run
    record.took(time.monotonic() - cut, LEASE + 4.0)
    assert stood(run) == [("SERVER_LOST", "SERVER_GONE")]
    until(lambda: journal.ends() == ["succeeded"], 12.0, what="the server goes on by itself")
    record.outcome = "SERVER_LOST, end SERVER_GONE, exit code 1"


@pytest.mark.chaos
def test_a_link_that_is_cut_for_ever_and_a_signal(
    site: NewSite, tree: Tree, record: Record
) -> None:
    """The link is cut for ever, stock lease; SIGTERM 1 s later, cancel deadline 2 s"""
    here = site()
    here.serve(short_lease=False)
    run = here.run(tree("/far/move", distance=9.0, timeout="{server: 5 s, cancel: 2 s}"))
    executing(run)
    here.machines.cut()
    assert holds_for(lambda: run.popen.poll() is None, 1.0)
    sent = time.monotonic()
    run.popen.terminate()
    run.line('"finished"')
    record.took(time.monotonic() - sent, 2.0 + 3.0)
    assert run.wait() == 3, run  # Fast DDS takes its time to go where no network is
    assert stood(run) == [("CANCELED", "UNKNOWN")]
    record.outcome = "CANCELED, end UNKNOWN; exit code 3, naming the goal"


@pytest.mark.chaos
@pytest.mark.timeout(300)
def test_a_link_that_loses_a_fifth_and_takes_200_ms(
    site: NewSite, tree: Tree, record: Record
) -> None:
    """20 % of all frames are lost and each takes 200 ms, both ways; ten goals in a row"""
    here = site(loss=0.2, delay=0.2)
    journal = here.serve(short_lease=False)
    # A message is offered again every 3 s, and arrives each second time: 30 s were not enough once.
    timeout = "{server: 60 s, accept: 60 s, result: 60 s, cancel: 90 s}"
    retry = "{attempts: 5, outcomes: [SERVER_LOST, ACCEPT_TIMEOUT, RESULT_TIMEOUT]}"
    run = here.run(tree("/far/move", distance=[0.2] * 10, timeout=timeout, retry=retry))
    began = time.monotonic()
    assert run.wait(270.0) == 0, str(run)
    record.took(time.monotonic() - began)
    agrees(run, journal)
    assert [outcome for outcome, _ in stood(run)].count("SUCCEEDED") == 10
    assert journal.max_live == 1
    record.outcome = "ten SUCCEEDED, exit code 0; the report agrees with the journal on every goal"


@pytest.mark.chaos
@pytest.mark.timeout(300)
def test_canceling_over_a_link_that_loses_a_fifth_and_takes_200_ms(
    site: NewSite, tmp_path: Path, record: Record
) -> None:
    """20 % lost, 200 ms both ways; a goal over its deadline is canceled, another follows"""
    here = site(loss=0.2, delay=0.2)
    journal = here.serve("1:slow=20", short_lease=False)
    timeout = "{queue: 60 s, server: 60 s, accept: 30 s, result: 3 s, cancel: 60 s}"
    run = here.run(first_or_second(tmp_path, timeout))
    code = run.wait(200.0)
    agrees(run, journal)
    assert code in (0, 1), run
    assert journal.ends()[0] == "canceled"
    assert journal.max_live == 1
    record.outcome = "RESULT_TIMEOUT, end CANCELED; the next only after it"


def agrees(run: Process, journal: Journal) -> None:
    """Every goal that the server accepted is in the report, with the end that the server knows."""
    assert journal.executed_twice == []
    reported = {goal["goal_id"]: goal["end"] for goal in goals(run)}
    for (_, goal), end in journal_ends(journal.entries()).items():
        assert end is not None, goal
        assert reported[goal] == str(end).upper(), goal
