"""Trees of Nav2, imported and served, and Nav2's servers beside them: processes of their own.

Their messages are built once by `bt-actions interfaces build`, and kept in build/ until the package
or what builds it changes. They are installed nowhere: our processes find them by their environment.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZipFile

import pytest

from bt_actions.simulation import journal
from tests.support.processes import ROOT, Process

if TYPE_CHECKING:
    from tests.support.tree_client import Sent, TreeClient

HERE = Path(__file__).parent
PACKAGE = HERE / "nav2_msgs"
BUILT_BY = ROOT / "bt_actions" / "packages"
TREES = sorted((HERE / "trees").glob("*.xml"))
MAIN = "import sys; from bt_actions.cli import main; sys.exit(main())"


@pytest.fixture(scope="session")
def nav2_msgs() -> dict[str, str]:
    """The environment of a process that has `nav2_msgs`, which is built where that is not done."""
    files = sorted(path for folder in (PACKAGE, BUILT_BY) for path in folder.rglob("*.*"))
    texts = b"".join(path.read_bytes() for path in files if path.suffix != ".pyc")
    key = hashlib.sha256(sys.version.encode() + texts).hexdigest()[:12]
    prefix = ROOT / "build" / f"nav2_msgs-{key}"
    prefix.parent.mkdir(exist_ok=True)
    with prefix.with_suffix(".lock").open("w") as lock:  # both workers may come at once
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not prefix.exists():
            _build(prefix)
    before = os.environ.get("LD_LIBRARY_PATH", "")
    return {
        "PYTHONPATH": f"{prefix}{os.pathsep}{ROOT}",
        "AMENT_PREFIX_PATH": str(prefix),
        "LD_LIBRARY_PATH": f"{prefix / 'lib'}{os.pathsep}{before}",
    }


def _build(prefix: Path) -> None:
    work = prefix.with_suffix(".new")
    shutil.rmtree(work, ignore_errors=True)
    command = ["nice", "-n", "5", sys.executable, "-c", MAIN, "interfaces", "build"]
    quick = os.environ | {"CMAKE_BUILD_TYPE": "None"}  # without optimisation: a third faster
    subprocess.run([*command, str(PACKAGE), "-o", str(work)], cwd=ROOT, env=quick, check=True)
    (wheel,) = work.glob("*.whl")
    with ZipFile(wheel) as opened:
        opened.extractall(work)
    (data,) = work.glob("*.data/data")
    shutil.copytree(data, work, dirs_exist_ok=True)
    work.rename(prefix)


class Nav2:
    """Imported trees that are served, Nav2's servers, and what the servers have written."""

    def __init__(self, servers: Process, path: Path, space: str, client: TreeClient) -> None:
        self.servers, self.path, self.space, self.client = servers, path, space, client
        self._seen = 0

    def play(self, **script: dict[str, Any]) -> None:
        """Have the servers do what a script says, and forget what they have written so far."""
        self.obey(**script)
        self._seen = len(self._lines())

    def obey(self, **script: dict[str, Any]) -> None:
        """Have the servers do what a script says."""
        self.servers.tell(json.dumps(script))
        self.servers.line("done")

    def _lines(self) -> list[journal.JournalLine]:
        return journal.read(self.path)

    @property
    def lines(self) -> list[journal.JournalLine]:
        """What the servers have written since the last `play`."""
        return self._lines()[self._seen :]

    def count(self, server: str, event: str = "received") -> int:
        """How often an event has happened on a server, or a service was called."""
        return sum(
            line.server.removeprefix(f"{self.space}/") == server and line.event == event
            for line in self.lines
        )

    def wait_for(self, server: str, event: str = "received", times: int = 1) -> None:
        """Wait until an event has happened so often on a server."""
        what = f"{event} x{times} on {server}"
        self.client.until(lambda: self.count(server, event) >= times, what)

    def goals(self, server: str) -> list[dict[str, Any]]:
        """The goals that a server was sent, in order."""
        return [
            line.more["fields"]
            for line in self.lines
            if line.server == f"{self.space}/{server}" and line.event == "received"
        ]

    @property
    def order(self) -> list[str]:
        """The servers in the order in which they were asked for something."""
        return [
            line.server.removeprefix(f"{self.space}/")
            for line in self.lines
            if line.event == "received"
        ]

    @property
    def ends(self) -> list[str]:
        """How the goals ended, server by server and in order; one that is live has `None`."""
        return [str(end) for end in journal.ends(self.lines).values()]

    def max_live(self, server: str) -> int:
        """How many goals of a server were live at once, at most."""
        return journal.max_live(self.lines, f"{self.space}/{server}")

    def send(self, tree: str, **inputs: Any) -> Sent:
        """Have a tree run."""
        sent = self.client.send(tree, json.dumps(inputs))
        assert sent.accepted, self.client.rejections
        return sent


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that trees are imported into, with the class that one of them needs."""
    folder = tmp_path_factory.mktemp("trees")
    shutil.copy(HERE / "leaves_to_write.py", folder)
    return folder


@pytest.fixture(scope="module")
def start(
    domain: int, nav2_msgs: dict[str, str], folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., Process]]:
    """Start a process that has `nav2_msgs`, for all tests of a module."""
    kept = tmp_path_factory.mktemp("kept")
    environment = nav2_msgs | {
        "PYTHONPATH": f"{nav2_msgs['PYTHONPATH']}{os.pathsep}{folder}",
        "BT_ACTIONS_LEDGER": str(kept / "ledger"),
        "XDG_STATE_HOME": str(kept / "state"),
    }
    processes: list[Process] = []

    def start(*arguments: str) -> Process:
        processes.append(Process(arguments, short_lease=True, environment=environment))
        return processes[-1]

    yield start
    for each in reversed(processes):
        each.close()


@pytest.fixture(scope="module")
def trees(start: Callable[..., Process], folder: Path) -> Path:
    """The folder with what `bt-actions import` has written."""
    options = ["-o", str(folder), "--map", str(HERE / "leaves.yaml")]
    process = start("-c", MAIN, "import", *map(str, TREES), *options)
    assert process.wait() == 0, process
    return folder


@pytest.fixture(scope="module")
def nav2(
    domain: int,
    trees: Path,
    start: Callable[..., Process],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Nav2]:
    """All of it, with `serve --policy replace`."""
    from rclpy.context import Context

    from tests.support.tree_client import TreeClient

    space = f"/nav2_{os.getpid()}"
    path = tmp_path_factory.mktemp("journal") / "nav2.jsonl"
    servers = start("-m", "tests.nav2.servers", space, str(path))
    options = ["--trees", str(trees), "--namespace", space, "--python", "leaves_to_write"]
    serve = start("-c", MAIN, "serve", *options, "--policy", "replace")
    servers.line("ready")
    serve.line("ready: ")
    context = Context()
    context.init(domain_id=domain)
    client = TreeClient(context, space)
    yield Nav2(servers, path, space, client)
    client.close()
    context.shutdown()
