"""`bt-actions render`: a tree as text, or as a file of the kind its name says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bt_actions.cli import main

CHECKOUT = Path(__file__).parents[2]
TREE = str(CHECKOUT / "trees" / "pick_and_place.yaml")


def test_without_a_file_the_tree_is_text_on_standard_output(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["render", TREE]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "{o} Deliver the part"
    assert "│  ├─ --> To the part  (move_robot: MoveRobot)" in lines


@pytest.mark.parametrize(
    ("suffix", "start"),
    [
        ("txt", b"{o}"),
        ("dot", b"digraph"),
        ("svg", b"<?xml"),
        ("png", b"\x89PNG"),
        ("html", b"<!doctype html>"),
    ],
)
def test_a_file_has_the_format_of_its_suffix(suffix: str, start: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"tree.{suffix.upper()}"
    assert main(["render", TREE, "-o", str(path)]) == 0
    assert path.read_bytes().startswith(start)


def test_a_file_that_is_not_there_is_told_where_an_installed_tree_is_taken(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["render", "patrol.yaml"]) == 0
    assert "there is no patrol.yaml in this folder; taking the installed" in capsys.readouterr().err
    assert main(["render", "patrol"]) == 0
    assert capsys.readouterr().err == ""


def test_a_tree_from_a_pipe_takes_inputs(capsys: pytest.CaptureFixture[str]) -> None:
    read, write = os.pipe()
    os.write(write, b"tree: t\ninputs: {n: {type: float64}}\nroot: {log: hello}\n")
    os.close(write)
    assert main(["render", f"/dev/fd/{read}", "--set", "n=2"]) == 0
    os.close(read)
    assert capsys.readouterr().out == "--> log hello  (log)\n"


def test_direction_is_respected(tmp_path: Path) -> None:
    path = tmp_path / "tree.dot"
    assert main(["render", TREE, "-o", str(path), "--direction", "right"]) == 0
    assert "rankdir=LR" in path.read_text()


def test_so_many_levels_are_shown(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["render", TREE, "--depth", "0"]) == 0
    assert capsys.readouterr().out.count("\n") == 1
    path = tmp_path / "tree.dot"
    assert main(["render", TREE, "-o", str(path), "--depth", "1"]) == 0
    assert " more" in path.read_text()


@pytest.mark.parametrize("levels", ["-1", "\u0663", "9" * 5000])
def test_a_depth_that_is_none_is_one_error(levels: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["render", TREE, f"--depth={levels}"])
    assert ended.value.code == 2
    assert "is no number of levels" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no_such_tree"], "there is no tree 'no_such_tree'"),
        ([TREE, "-o", "tree.gif"], "tree.gif: cannot tell the format from the suffix"),
        ([TREE, "-o", "/no/such/folder/tree.svg"], "/no/such/folder/tree.svg: cannot be written"),
        ([TREE, "--set", "pick_at=x"], "--set pick_at=x"),
    ],
)
def test_bad_input_is_one_error_and_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", *arguments]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert message in said.err
    assert "Traceback" not in said.err


def test_it_needs_no_rclpy_no_dot_and_no_utf_8(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['rclpy'] = None;"
        "from bt_actions.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    environment = os.environ | {
        "PATH": "/nowhere",
        "PYTHONPATH": str(CHECKOUT),
        "PYTHONIOENCODING": "ascii",
    }
    for arguments in (
        ["render", TREE],
        ["render", TREE, "-o", "tree.png"],
        ["render", TREE, "-o", "tree.html"],
    ):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, b"")
        assert done.stdout.isascii()
    assert (tmp_path / "tree.png").stat().st_size > 10_000
    assert "MoveRobot.Goal" in (tmp_path / "tree.html").read_text()


def test_head_closes_its_end_without_a_complaint() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "bt_actions.cli", "render", TREE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=CHECKOUT,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.wait(20.0) == 141
        assert process.stderr.read() == b""
