"""What pip installs of the project, as a wheel and as an editable install."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile

import pytest

from bt_actions.ros.environment import SHORT_LEASE

ROOT = Path(__file__).resolve().parents[2]
DATA = "bt_actions-0.1.0.data/data"


@pytest.fixture(scope="module", params=["build_wheel", "build_editable"])
def wheel(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[ZipFile]:
    pytest.importorskip("setuptools", minversion="68")
    copy = tmp_path_factory.mktemp("project")
    for name in ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    for name in ("bt_actions", "foxglove", "launch", "resource", "trees"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    build = f"from setuptools import build_meta; build_meta.{request.param}('.')"
    subprocess.run([sys.executable, "-c", build], cwd=copy, check=True, capture_output=True)
    (built,) = copy.glob("*.whl")
    with ZipFile(built) as opened:
        yield opened


def test_trees_launch_files_and_layouts_are_where_ros_looks_for_them(wheel: ZipFile) -> None:
    share = f"{DATA}/share/bt_actions/"
    installed = {name.removeprefix(share) for name in wheel.namelist() if name.startswith(share)}
    trees = {str(tree.relative_to(ROOT)) for tree in (ROOT / "trees").rglob("*.y*ml")}
    launch = {str(file.relative_to(ROOT)) for file in (ROOT / "launch").glob("*.launch.py")}
    layouts = {str(file.relative_to(ROOT)) for file in (ROOT / "foxglove").glob("*.json")}
    assert trees
    assert launch
    assert layouts
    assert installed == trees | launch | layouts | {"package.xml"}


def test_the_package_is_registered_with_ament(wheel: ZipFile) -> None:
    assert f"{DATA}/share/ament_index/resource_index/packages/bt_actions" in wheel.namelist()


def test_ros2_run_finds_the_command_in_the_prefix(wheel: ZipFile, tmp_path: Path) -> None:
    """pip, too, keeps the mode that the wheel gives a file."""
    (name,) = (each for each in wheel.namelist() if each.endswith("/lib/bt_actions/bt-actions"))
    assert name.startswith(DATA)
    mode = wheel.getinfo(name).external_attr >> 16
    assert mode & 0o111 == 0o111
    for path, text in (
        (tmp_path / "lib" / "bt_actions" / "bt-actions", wheel.read(name).decode()),
        (tmp_path / "bin" / "bt-actions", '#!/bin/sh\necho "$0: $*"\n'),
    ):
        path.parent.mkdir(parents=True)
        path.write_text(text)
        path.chmod(mode)
    done = subprocess.run(
        [tmp_path / "lib" / "bt_actions" / "bt-actions", "run", "a b"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.endswith("/bin/bt-actions: run a b\n")


def test_the_command_is_installed(wheel: ZipFile) -> None:
    entry_points = wheel.read("bt_actions-0.1.0.dist-info/entry_points.txt").decode()
    assert "bt-actions = bt_actions.cli:main" in entry_points


def test_modules_the_page_the_lease_and_the_mark_of_a_typed_package_are_in_the_wheel(
    wheel: ZipFile,
) -> None:
    if "editable" in str(wheel.filename):
        pytest.skip("an editable install points at the sources")
    package = ROOT / "bt_actions"
    sources = {str(path.relative_to(ROOT)) for path in package.rglob("*.py")}
    page = {str(path.relative_to(ROOT)) for path in package.glob("*/static/*")}
    page |= {
        f"bt_actions/render/{name}" for name in ("page.html", "page.css", "page.js", "card.js")
    }
    assert {"bt_actions/page/static/main.js", "bt_actions/render/static/layout.js"} <= page
    others = {"bt_actions/py.typed", str(SHORT_LEASE.relative_to(ROOT))}
    others |= {
        f"bt_actions/packages/{name}" for name in ("build_environment.txt", "ros_wheels.cmake")
    }
    assert sources | page | others <= set(wheel.namelist())


def test_it_refuses_a_python_that_ros_2_jazzy_has_no_wheels_for(wheel: ZipFile) -> None:
    metadata = wheel.read("bt_actions-0.1.0.dist-info/METADATA").decode()
    (line,) = (line for line in metadata.splitlines() if line.startswith("Requires-Python"))
    assert sorted(line.removeprefix("Requires-Python: ").split(",")) == ["<3.13", ">=3.11"]


def test_the_command_runs_from_anywhere(tmp_path: Path) -> None:
    command = Path(sys.executable).parent / "bt-actions"
    # As a shell has it: this process, restarted by the ROS wheels, hands down more.
    environment = {"PATH": os.environ["PATH"], "HOME": str(tmp_path)}
    if not command.exists():
        pytest.skip("the package is not installed in this environment")
    done = subprocess.run(
        [command, "--help"], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "run" in done.stdout
