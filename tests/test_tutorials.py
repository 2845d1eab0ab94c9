"""What the tutorials show works as it stands there, in the order in which it stands there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.middleware import on_loopback

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Reader:
    """Does what a page says, in a copy of what the page is about."""

    def __init__(self, page: str, where: Path) -> None:
        self.blocks = BLOCK.findall((ROOT / "docs" / "tutorials" / page).read_text())
        self.codes: list[int] = []
        self._where, self._said = where, ""
        ours = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        self._environment = {
            **os.environ,
            **on_loopback(short_lease=False),
            "PATH": ours,
            "PYTHONPATH": str(ROOT),
        }

    def run(self, block: str) -> None:
        """Type what a block of shell says."""
        done = subprocess.run(
            ["bash", "-e", "-c", block],
            cwd=self._where,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=120.0,
        )
        self._said = done.stdout
        self.codes.append(done.returncode)

    def compare(self, block: str) -> None:
        """Find each line of a block in what was said last."""
        for line in block.splitlines():
            assert line in self._said, self._said

    def change(self, path: str, block: str) -> None:
        """Make the one change of a block."""
        (old,), (new,) = (re.findall(rf"^\{sign}(.*)", block, re.MULTILINE) for sign in "-+")
        text = (self._where / path).read_text()
        assert text.count(old) == 1
        (self._where / path).write_text(text.replace(old, new))


@pytest.mark.ros
def test_it_failed_at_night(domain: int, tmp_path: Path) -> None:
    for name in ("examples/night", "trees"):
        shutil.copytree(ROOT / name, tmp_path / name)
    reader = Reader("it_failed_at_night.md", tmp_path)
    for language, block in reader.blocks:
        if language == "sh":
            reader.run(block)
        elif language == "text":
            reader.compare(block)
        elif language == "diff":
            reader.change("examples/night/night.yaml", block)
        elif "def test_" in block:
            (tmp_path / "examples/night/test_night.py").write_text(block)
        else:
            exec(block, {})
    assert reader.codes == [1, 0, 1, 0, 1, 0]
