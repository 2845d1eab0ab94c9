"""Message packages of one's own, built on ROS 2 wheels, installed, and used by a tree.

Each test has a copy of this environment, in which packages can be installed. What they are built
with is made once, in the cache of the user.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.packages.conftest import Write
from tests.support.environments import HIDDEN, copy_environment

DATA = Path(__file__).with_name("data")
PATIENCE = 900.0
"""Seconds for a build on a machine that does other work besides."""
SERVER = """\
import sys
import rclpy
from rclpy.action import ActionServer
from fetch_msgs.action import Fetch

def execute(handle):
    (crate, other) = handle.request.crates
    assert (crate.label, other.label, crate.pose.position.x) == ("first", "none", 2.0)
    handle.succeed()
    return Fetch.Result(error_code=Fetch.Result.TOO_HEAVY)

rclpy.init()
node = rclpy.create_node("fetcher")
server = ActionServer(node, Fetch, sys.argv[1], execute)
print("ready", flush=True)
rclpy.spin(node)
"""
TREE = """\
tree: fetch
outputs: {{code: {{type: uint16}}}}
actions:
  fetch: {{type: fetch_msgs/action/Fetch, server: {server}, timeout: 20 s}}
root:
  fetch: Fetch both
  goal: {{crates: [{{label: first, pose: {{position: {{x: 2.0}}}}}}, {{}}]}}
  expect: result.error_code == Fetch.Result.TOO_HEAVY
  save: {{code: result.error_code}}
"""

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.timeout(PATIENCE),
    pytest.mark.skipif(
        not (Path(sys.prefix) / "share" / "rosidl_runtime_c" / "cmake").is_dir(),
        reason="ROS does not come from wheels here",
    ),
]

Run = Callable[..., subprocess.CompletedProcess[str]]


class Environment:
    """A copy of this environment; `run` is its Python."""

    def __init__(self, prefix: Path) -> None:
        self.prefix = prefix
        self.python = prefix / "bin" / "python"
        self.before: set[str] = set()
        self.before = {f"{name}-{version}" for name, version in self.versions().items()}
        self.variables = {key: value for key, value in os.environ.items() if key not in HIDDEN}

    def start(self, *arguments: object) -> subprocess.Popen[str]:
        """Start its Python, with a lower priority than the other tests."""
        return subprocess.Popen(
            ["nice", "-n", "5", str(self.python), *map(str, arguments)],
            env=self.variables, cwd=self.prefix, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def cli(self, *arguments: object, code: int = 0) -> str:
        """Run `bt-actions`; return what it said, on both streams."""
        process = self.start("-m", "bt_actions.cli", *arguments)
        said = "".join(process.communicate(timeout=PATIENCE))
        assert process.returncode == code, said
        assert "Traceback" not in said
        return said

    def versions(self) -> dict[str, str]:
        """The packages that have been installed into it."""
        found = (self.prefix / "lib").glob("python*/site-packages/*_msgs-*.dist-info")
        names = {path.name.removesuffix(".dist-info") for path in found}
        return dict(name.split("-") for name in sorted(names - self.before))


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[Environment]:
    """A copy of this environment."""
    prefix = tmp_path / "environment"
    copy_environment(prefix)
    yield Environment(prefix)
    shutil.rmtree(prefix)


def copy(name: str, folder: Path) -> Path:
    shutil.copytree(DATA / name, folder / name)
    return folder / name


def test_a_package_of_ones_own_is_built_upon_another_and_used_by_a_tree(
    environment: Environment, domain: int, name: str, tmp_path: Path
) -> None:
    source = copy("fetch_msgs", tmp_path / "first")
    said = environment.cli("interfaces", "build", source, code=2)
    assert "shelf_msgs/Crate is used, and shelf_msgs is not there: give the path" in said

    shelf = copy("shelf_msgs", tmp_path / "second")
    said = environment.cli("interfaces", "build", shelf)
    assert "shelf_msgs: compiling" in said
    assert re.search(r"^installed shelf_msgs 1\.2\.0 in \d+ s$", said, re.MULTILINE)
    # Upon a wheel that is installed: its headers, its exports.
    said = environment.cli("interfaces", "build", source, "--no-network")
    assert environment.versions() == {"shelf_msgs": "1.2.0", "fetch_msgs": "1.2.0"}
    assert not (source / "build").exists()

    shown = environment.cli("interfaces", "show", "Fetch")
    assert "shelf_msgs/Crate[] crates\n\tuint8 EMPTY=0\n" in shown
    assert environment.cli("interfaces", "list", "fetch_msgs").splitlines() == [
        "fetch_msgs/action/Fetch", "fetch_msgs/srv/Count",
    ]  # fmt: skip
    tree = tmp_path / "fetch.yaml"
    tree.write_text(TREE.format(server=name))
    assert environment.cli("check", tree) == ""
    server = environment.start("-c", SERVER, name)
    try:
        assert server.stdout is not None
        assert server.stdout.readline() == "ready\n"
        assert "code: 101" in environment.cli("run", tree)
    finally:
        server.kill()
        server.communicate()

    older = (shelf / "package.xml").read_text().replace("1.2.0", "1.1.0")
    (shelf / "package.xml").write_text(older)
    said = environment.cli("interfaces", "build", shelf, code=2)
    assert "shelf_msgs is 1.1.0, and 1.2.0 is installed" in said
    assert environment.versions()["shelf_msgs"] == "1.2.0"


def test_what_does_not_compile_is_told_and_installs_nothing(
    environment: Environment, write: Write, tmp_path: Path
) -> None:
    first = write("good_msgs", {"msg/A.msg": "int32 a\n"})
    second = write("worse_msgs", {"msg/B.msg": "good_msgs/A a\nint32 class\n", "msg/C.idl": "no"})
    said = environment.cli("interfaces", "build", first, second, code=2)
    assert "good_msgs: packing" in said
    line, where = said.splitlines()[-2:]
    assert re.match(
        r"bt-actions: interfaces build: (configuring|compiling) worse_msgs failed", line
    )
    assert Path(where.removeprefix("All that CMake said is in ")).read_text()
    assert environment.versions() == {}


def test_ctrl_c_ends_all_it_started_and_leaves_nothing(
    environment: Environment, write: Write, tmp_path: Path
) -> None:
    environment.variables["TMPDIR"] = str(tmp_path / "temporary")
    (tmp_path / "temporary").mkdir()
    source = write("slow_msgs", {f"msg/A{number}.msg": "int32 a\n" for number in range(40)})
    process = environment.start("-m", "bt_actions.cli", "interfaces", "build", source)
    assert process.stderr is not None
    while "compiling" not in (line := process.stderr.readline()):
        assert line
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert time.monotonic() - began < 20.0
    left = [path.name for path in (tmp_path / "temporary").iterdir()]
    assert not [name for name in left if "build" in name or "wheels" in name]
    assert environment.versions() == {}
    running = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout
    assert str(tmp_path / "temporary") not in running
