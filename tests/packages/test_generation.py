"""What is said where the tools of a build are missing, or fail."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from bt_actions.packages import PackageError
from bt_actions.packages.environment import Tools
from bt_actions.packages.generation import generate
from bt_actions.packages.sources import read_package
from tests.packages.conftest import Write

pytest.importorskip("rosidl_adapter")


def failed(write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, **tools: str) -> str:
    """What is said of a package that these shell scripts build."""
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    commands = tmp_path / "tools" / "bin"
    commands.mkdir(parents=True)
    for name, script in tools.items():
        (commands / name).write_text(f"#!/bin/sh\n{script}\n")
        (commands / name).chmod(0o755)
    source = read_package(write("my_msgs", {"msg/A.msg": "int32 a\n"}))
    with pytest.raises(PackageError) as raised:
        generate(source, [], Tools(Path(sys.executable), commands.parent), tmp_path / "work", print)
    return str(raised.value)


@pytest.mark.parametrize("there", ["cmake", "ninja"])
def test_without_cmake_or_ninja_the_folder_is_named(
    there: str, write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = failed(write, tmp_path, monkeypatch, **{there: "exit 0"})
    assert said == (
        f"there is no CMake or no Ninja in {tmp_path}/tools: delete that folder, and try again"
    )


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        ("CMake Error at x:1 (message):\n\n  no such thing\n  at all", "no such thing at all"),
        ("In file\nx.h:4:2: error: expected ;\nx.h:5: error: more", "x.h:4:2: error: expected ;"),
        ('Traceback (x):\n  File "x"\nValueError: bad\nCMake Error', "ValueError: bad"),
        ("nothing\nat the end", "at the end"),
    ],
)  # fmt: skip
def test_a_step_that_fails_is_told_with_its_reason_and_the_whole_log(
    log: str, reason: str, write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = f"echo '{log}'; exit 1"
    said = failed(write, tmp_path, monkeypatch, cmake=script, ninja="exit 0")
    first, second = said.splitlines()
    assert first == f"configuring my_msgs failed: {reason}"
    kept = Path(second.removeprefix("All that CMake said is in "))
    assert kept == tmp_path / "cache" / "bt_actions" / "my_msgs.log"
    assert kept.read_text() == f"{log}\n"
