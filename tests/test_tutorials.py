"""What the tutorials show works as it stands there, in the order in which it stands there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.environments import HIDDEN, copy_environment, own_commands
from tests.support.middleware import on_loopback
from tests.support.processes import HostFactory, Process

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs" / "tutorials"
STAND_INS = ROOT / "tests" / "support" / "stand_ins"
BLOCK = re.compile(r"(?:`([^`\n]+)`:\n\n)?^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
"""What a block is in, where the line before it says so: its file, its language, its text."""

PATIENCE = 900.0
"""Seconds for a build of messages on a machine that does other work besides."""
TIDY = "trap 'kill $(jobs -p) 2> /dev/null || true' EXIT"
"""Ends the servers of a block whose program failed."""
Start = Callable[..., Process]
CAN_BUILD = (Path(sys.prefix) / "share" / "rosidl_runtime_c" / "cmake").is_dir()


class Reader:
    """Does what a page says, in a folder of its own."""

    def __init__(self, where: Path, prefix: Path = Path(sys.prefix)) -> None:
        self.codes: list[int] = []
        self._where, self._said = where, ""
        self._environment = {
            **{name: value for name, value in os.environ.items() if name not in HIDDEN},
            **on_loopback(short_lease=False),
            "PATH": f"{prefix / 'bin'}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
        }

    def follow(self, page: str) -> list[int]:
        """Do all that a page says; return the exit code of each block of shell."""
        for file, language, block in BLOCK.findall((PAGES / page).read_text(encoding="utf-8")):
            if language == "sh":
                self._run(block)
            elif language == "text":
                self._compare(block)
            elif language == "diff":
                self._change(file, block)
            elif file:
                (self._where / file).write_text(block, encoding="utf-8")
            elif language == "python":
                exec(block, {})
        return self.codes

    def _run(self, block: str) -> None:
        """Type what a block of shell says."""
        done = subprocess.run(
            ["bash", "-e", "-c", f"{TIDY}\n{block}"],
            cwd=self._where,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=PATIENCE,
        )
        self._said = done.stdout
        self.codes.append(done.returncode)

    def _compare(self, block: str) -> None:
        """Find each line of a block in what was said last."""
        for line in block.splitlines():
            assert line in self._said, self._said

    def _change(self, path: str, block: str) -> None:
        """Make the one change of a block."""
        (old,), (new,) = (re.findall(rf"^\{sign}(.*)", block, re.MULTILINE) for sign in "-+")
        text = (self._where / path).read_text()
        assert text.count(old) == 1
        (self._where / path).write_text(text.replace(old, new))


def assert_drawn(tree: Path) -> None:
    """Find a page's tree in examples/, whence the page's picture is made."""
    drawn = ROOT / "examples" / tree.stem / tree.name
    assert tree.read_text(encoding="utf-8") == drawn.read_text(encoding="utf-8")


pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("domain")]


def test_the_first_tree(tmp_path: Path) -> None:
    assert Reader(tmp_path).follow("first_tree.md") == [0, 1, 0, 0]
    assert_drawn(tmp_path / "first.yaml")


@pytest.mark.slow
@pytest.mark.timeout(PATIENCE)
@pytest.mark.skipif(not CAN_BUILD, reason="ROS does not come from wheels here")
def test_an_action_of_ones_own(tmp_path: Path) -> None:
    prefix = tmp_path / "environment"
    copy_environment(prefix)
    own_commands(prefix, "bt-actions", "pytest")
    assert Reader(tmp_path, prefix).follow("own_action.md") == [0, 0, 1, 0, 0]
    shutil.rmtree(prefix)
    assert_drawn(tmp_path / "dock.yaml")


def test_from_py_trees_ros_leaf_by_leaf(tmp_path: Path) -> None:
    assert Reader(tmp_path).follow("leaf_by_leaf.md") == [0, 0, 0]


@pytest.mark.parametrize("leaves", ["all of py_trees_ros", "the drive of ours"])
def test_the_programs_of_py_trees_ros_fetch_the_part_with_a_stand_in(
    leaves: str, tmp_path: Path, start_program: Start, new_host: HostFactory
) -> None:
    page = (PAGES / "leaf_by_leaf.md").read_text(encoding="utf-8")
    text, added = re.findall(r"^```python there\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert text.count("\nroot = ") == 1
    if leaves == "the drive of ours":
        text = text.replace("\nroot = ", f"\n{added}root = ")
    new_host().robot("", "1:abort", speed=20.0)
    (tmp_path / "there.py").write_text(text, encoding="utf-8")
    paths = {"PYTHONPATH": f"{ROOT}:{STAND_INS}"}
    program = start_program(str(tmp_path / "there.py"), environment=paths)
    assert program.wait(40.0) == 0, program
    assert program.lines[-1] == "Status.SUCCESS", program


def test_it_failed_at_night(tmp_path: Path) -> None:
    for name in ("examples/night", "trees"):
        shutil.copytree(ROOT / name, tmp_path / name)
    assert Reader(tmp_path).follow("it_failed_at_night.md") == [1, 0, 1, 0, 1, 0]


def test_every_tutorial_is_followed() -> None:
    followed = re.findall(r'follow\("(.+)"\)', Path(__file__).read_text(encoding="utf-8"))
    assert sorted(followed) == sorted(page.name for page in PAGES.glob("*.md"))
