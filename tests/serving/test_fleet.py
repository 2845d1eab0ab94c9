"""A fleet: a tree on one machine runs trees on another, and the link between them is cut.

The machines are two network namespaces that the test makes; servers of trees and robots are on b,
the tree of trees is on a.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions.ros.environment import PROFILE, SHORT_LEASE
from tests.serving.conftest import MAIN, MOVE
from tests.support.network import Machines
from tests.support.processes import Host, Process
from tests.support.waiting import holds_for

ON_THE_NETWORK = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # /dev/shm would be a link that nobody can cut
    PROFILE: "",
}
STOCK_LEASE = """\
<dds xmlns="http://www.eprosima.com">
  <profiles>
    <participant profile_name="stock" is_default_profile="true"><rtps/></participant>
  </profiles>
</dds>
"""
"""A server of trees gives itself the short one where the user has set nothing."""
ROBOTS = ("/r1", "/r2")
FLEET = """\
tree: fleet
root:
  parallel: Both robots
  children:
"""
ROBOT = """\
    - run_tree: Move {robot}
      tree: move
      server: {robot}/run_tree
      inputs: {{distance: {distance}}}
      timeout: {{server: 20 s, accept: 10 s, result: 60 s, {deadlines}}}
"""


class Fleet:
    """Robots and their servers of trees on b, and a tree of trees on a."""

    def __init__(self, machines: Machines, directory: Path) -> None:
        self.machines = machines
        self._directory = directory
        self._processes: list[Process] = []

    def begin(self, distance: float, deadlines: str, lease: Path = SHORT_LEASE) -> None:
        """Start it all, and wait until both robots move."""
        environment = {**ON_THE_NETWORK, PROFILE: str(lease)}
        far: Any = {"prefix": self.machines.on(self.machines.b), "environment": environment}
        host = Host(self._directory, **far)
        self._processes.append(host)
        self.journals = [host.open(f"{robot}/move") for robot in ROBOTS]
        trees = self._directory / "trees"
        trees.mkdir()
        (trees / "move.yaml").write_text(MOVE.format(server="move", cancel="5 s"))
        self.servers = []
        for robot in ROBOTS:
            command = ["-c", MAIN, "serve", "--trees", str(trees), "--namespace", robot]
            self.servers.append(Process(command, **far))
        self._processes += self.servers
        for server in self.servers:
            server.line("ready: ")
        leaves = [ROBOT.format(robot=r, distance=distance, deadlines=deadlines) for r in ROBOTS]
        fleet = self._directory / "fleet.yaml"
        fleet.write_text(FLEET + "".join(leaves))
        self.run = Process(
            ["-c", MAIN, "run", str(fleet), "--json"],
            prefix=self.machines.on(self.machines.a),
            environment=ON_THE_NETWORK,
        )
        self._processes.append(self.run)
        for journal in self.journals:
            journal.wait_for("accepted", within=20.0)

    def report(self) -> dict[str, Any]:
        """What is told at the end of the run."""
        told: dict[str, Any] = json.loads(self.run.line('"finished"', within=60.0))
        return told

    def ends(self) -> list[list[str | None]]:
        """How the goals of each robot ended, by its journal."""
        return [journal.ends() for journal in self.journals]

    def close(self) -> None:
        for each in reversed(self._processes):
            each.close()
        self.machines.close()


@pytest.fixture
def fleet(domain: int, tmp_path: Path) -> Iterator[Fleet]:
    """The two machines; the test is skipped where they cannot be made."""
    try:
        machines = Machines()
    except OSError as error:
        pytest.skip(f"two network namespaces cannot be made and joined here: {error}")
    fleet = Fleet(machines, tmp_path)
    yield fleet
    fleet.close()


@pytest.fixture
def stock(tmp_path: Path) -> Path:
    """The lease that servers have where nobody cares: 20 s."""
    path = tmp_path / "stock.xml"
    path.write_text(STOCK_LEASE)
    return path


@pytest.mark.parametrize(
    "cut", [pytest.param(0.0, marks=pytest.mark.chaos), 1.0], ids=["not cut", "cut for 1 s"]
)
def test_a_link_that_is_back_soon_is_no_reason_to_fail(fleet: Fleet, cut: float) -> None:
    fleet.begin(4.0, "feedback: 5 s, cancel: 5 s")
    if cut:
        fleet.machines.cut()
        assert holds_for(lambda: fleet.run.popen.poll() is None, cut)
        fleet.machines.join()
    report = fleet.report()
    assert (report["status"], report["exit_code"]) == ("SUCCESS", 0)
    assert fleet.ends() == [["succeeded"]] * 2


@pytest.mark.chaos
def test_a_link_that_stays_cut_leaves_ends_that_nobody_knows(fleet: Fleet, stock: Path) -> None:
    fleet.begin(20.0, "feedback: 2 s, cancel: 2 s", stock)
    fleet.machines.cut()
    report = fleet.report()
    assert fleet.ends() == [[None]] * 2, "the robots go on"
    assert report["exit_code"] == 3
    assert [each["end"] for each in report["actions"]] == ["UNKNOWN"] * 2
    assert all(any(robot in each for each in report["unaccounted"]) for robot in ROBOTS)


@pytest.mark.chaos
def test_what_was_given_up_is_canceled_when_the_link_is_back(fleet: Fleet, stock: Path) -> None:
    fleet.begin(60.0, "feedback: 2 s, cancel: 30 s", stock)
    fleet.machines.cut()
    assert holds_for(lambda: fleet.run.popen.poll() is None, 5.0)
    assert fleet.ends() == [[None]] * 2
    fleet.machines.join()
    report = fleet.report()
    assert fleet.ends() == [["canceled"]] * 2, "before it was told"
    assert report["exit_code"] == 1
    assert [each["end"] for each in report["actions"]] == ["CANCELED"] * 2
