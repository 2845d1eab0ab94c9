"""Standard output that cannot be written, or is not there: one line on stderr, the right code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FULL = Path("/dev/full")
DEMO = ("run", "pick_and_place", "--sim", "--speed", "30")


def call(redirection: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Call `bt-actions` from a shell, its standard output redirected."""
    command = f'exec "$0" -m bt_actions.cli "$@" {redirection}'
    return subprocess.run(
        ["sh", "-c", command, sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["--version"],
        ["run", "--help"],
        ["schema"],
        ["render", "recover"],
        ["explain"],
        ["explain", "BT203"],
        ["completion", "bash"],
        ["check", "no_such_tree"],
    ],
    ids=" ".join,
)
def test_output_that_is_lost_is_one_line_and_exit_code_2(arguments: list[str]) -> None:
    done = call(f">{FULL}", *arguments)
    assert done.returncode == 2
    assert done.stderr == (
        "bt-actions: standard output cannot be written: No space left on device\n"
    )


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
@pytest.mark.parametrize("more", [[], ["--json"]], ids=["lines", "json"])
def test_a_run_whose_result_is_lost_is_no_success(more: list[str], domain: int) -> None:
    done = call(f">{FULL}", *DEMO, *more)
    assert done.returncode == 1
    lost, ended = done.stderr.splitlines()
    assert lost.startswith("bt-actions: nothing more can be shown, and the run goes on: ")
    assert ended == "bt-actions: the tree has succeeded; exit code 1, as that could not be shown"
    assert "Traceback" not in done.stderr


def test_a_standard_output_that_is_closed_is_one_that_goes_nowhere(domain: int) -> None:
    done = call(">&-", *DEMO)
    assert (done.returncode, done.stderr) == (0, "")


def test_help_without_a_standard_output_is_no_error() -> None:
    assert call(">&-", "--help").returncode == 0


def test_without_a_home_a_run_works_all_the_same(domain: int) -> None:
    kept = ("PATH", "ROS_DOMAIN_ID")
    bare = {name: os.environ[name] for name in kept if name in os.environ}
    done = subprocess.run(
        [sys.executable, "-m", "bt_actions.cli", *DEMO],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**bare, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "SUCCESS after" in done.stdout.splitlines()[-1]


def test_the_text_of_format_that_is_lost_is_an_error_too(tmp_path: Path) -> None:
    if not FULL.exists():
        pytest.skip("needs /dev/full")
    path = tmp_path / "t.yaml"
    path.write_text("tree: t\nroot: {success: A}\n")
    assert call(f"<{path} >{FULL}", "format", "-").returncode == 2
