"""TAB in a shell: what is offered for a line, by argcomplete's own function for bash."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from py_trees.common import Status

from bt_actions.cli.program import COMMANDS
from tests.support.recordings import record
from tests.support.told_trees import FakeNode, Story

CHECKOUT = Path(__file__).parents[2]
PATH = {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
FAULT = "run pick_and_place --sim --fault"


def bash_completes(line: str) -> list[str]:
    """What bash offers for `bt-actions` and a line that is being typed."""
    script = """\
eval "$(register-python-argcomplete bt-actions)"
COMP_LINE=$1 COMP_POINT=${#1} COMP_TYPE=9
_python_argcomplete bt-actions
printf '%s\\n' "${COMPREPLY[@]}"
"""
    done = subprocess.run(
        ["bash", "-c", script, "bash", f"bt-actions {line}"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | PATH,
        cwd=CHECKOUT,
    )
    assert done.stderr == ""
    return [word.rstrip(" ") for word in done.stdout.splitlines()]


pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("ren", ["render"]),
        ("", ["-h", "--help", "--version", *COMMANDS]),
        ("run --exec", ["--executor"]),
        ("run --executor m", ["multi"]),
        ("interfaces sh", ["show"]),
        ("interfaces build --no", ["--no-network"]),
        ("control /run_tree p", ["pause"]),
        ("explain BT10", [f"BT10{digit}" for digit in range(10)]),
        ("run pick", ["pick_and_place"]),
        ("run trees/pick", ["trees/pick_and_place.yaml"]),
        ("run robo", [""]),  # is for trees to import
        ("run pick_and_place --set ", ["pick_at=", "place_at="]),
        ("run trees/pick_and_place.yaml --set pl", ["place_at="]),
        ("render trees/patrol.yaml --set nowhere", [""]),
        ("run nowhere --set p", [""]),
        (f"{FAULT} m", ["move_robot:"]),
        (f"{FAULT} move_robot:2:ab", ["abort", "abort_on_cancel"]),
        (f"{FAULT} /r1/move_robot:2:stal", ["stall"]),
        ("sim --fault grip", ["gripper_control:"]),
    ],
)
def test_bash_completes(line: str, offered: list[str]) -> None:
    assert bash_completes(line) == offered


def test_bash_completes_files(tmp_path: Path) -> None:
    (tmp_path / "a tree.yaml").touch()
    assert bash_completes(f"run {tmp_path}/a") == [f"{tmp_path}/a\\ tree.yaml"]


def test_a_tree_that_cannot_be_read_is_not_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pick_gone.yaml").symlink_to(tmp_path / "nowhere")
    monkeypatch.setenv("BT_ACTIONS_TREE_PATH", str(tmp_path))
    assert bash_completes("run pick") == ["pick_and_place"]


def test_bash_completes_runs_by_id_and_by_tree() -> None:
    for letter in "ab":
        story = Story(FakeNode("deliver"))
        story.began = replace(story.began, run_id=letter * 32)
        record([story.began, story.finish(Status.SUCCESS)])
    assert sorted(bash_completes("report ")) == ["aaaaaaaa", "bbbbbbbb", "deliver"]
    assert bash_completes("report b") == ["bbbbbbbb"]
    assert sorted(bash_completes("watch ")) == ["aaaaaaaa", "bbbbbbbb", "deliver"]
    assert bash_completes("runs --tree ") == bash_completes("stats --tree ") == ["deliver"]


@pytest.mark.parametrize("line", ["", "run ", "run pick_and_place --set ", "explain ", "report "])
def test_an_answer_waits_for_nothing_slow(line: str) -> None:
    story = Story(FakeNode("deliver"))
    record([story.began])
    line = f"bt-actions {line}"
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    done = subprocess.run(
        ["bash", "-c", "bt-actions 8>&1"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | PATH | asked | {"PYTHONPROFILEIMPORTTIME": "1"},
    )
    imported = {each.rpartition("|")[2].strip() for each in done.stderr.splitlines()}
    assert done.stdout != ""
    assert "argcomplete" in imported
    assert not imported & {"py_trees", "rclpy", "rich", "bt_actions.document.load"}
