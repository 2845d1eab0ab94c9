"""The completion scripts, asked by the shells themselves where they are installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from bt_actions import cli
from bt_actions.cli.program import COMMANDS, build_parser


@pytest.fixture
def script(request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]) -> str:
    """The script for the shell that the test is parametrized with."""
    assert cli.main(["completion", request.param]) == 0
    return capsys.readouterr().out


def bash_completes(script: str, *words: str) -> list[str]:
    """What bash offers after `words`, the last of which is being typed."""
    line = f"""{script}
COMP_WORDS=({" ".join(f"'{word}'" for word in words)}); COMP_CWORD={len(words) - 1}
_bt_actions; printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_bash_completes_commands_options_and_choices(script: str) -> None:
    assert bash_completes(script, "bt-actions", "re") == ["render"]
    assert set(bash_completes(script, "bt-actions", "")) >= {*COMMANDS, "--help"}
    assert bash_completes(script, "bt-actions", "run", "--exec") == ["--executor"]
    assert bash_completes(script, "bt-actions", "run", "--executor", "m") == ["multi"]
    assert bash_completes(script, "bt-actions", "completion", "z") == ["zsh"]
    assert "show" in bash_completes(script, "bt-actions", "interfaces", "sh")
    assert bash_completes(script, "bt-actions", "interfaces", "build", "--no") == ["--no-network"]
    assert bash_completes(script, "bt-actions", "control", "/run_tree", "p") == ["pause"]


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_bash_completes_trees_inputs_faults_and_rules(script: str) -> None:
    assert "pick_and_place" in bash_completes(script, "bt-actions", "run", "pick")
    assert bash_completes(script, "bt-actions", "run", "robot") == [""], "holds no tree"
    named = ("bt-actions", "run", "pick_and_place", "--set")
    assert bash_completes(script, *named, "") == ["pick_at=", "place_at="]
    by_path = ("bt-actions", "run", "trees/pick_and_place.yaml", "--set")
    assert bash_completes(script, *by_path, "pl") == ["place_at="]
    fault = ("bt-actions", "run", "pick_and_place", "--sim", "--fault")
    assert bash_completes(script, *fault, "m") == ["move_robot:"]
    assert bash_completes(script, *fault, "move_robot", ":", "2", ":", "ab") == [
        "abort",
        "abort_on_cancel",
    ]
    assert "stall" in bash_completes(script, *fault, "move_robot", ":", "2", ":")
    assert bash_completes(script, "bt-actions", "explain", "BT10")[0] == "BT100"


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_bash_completes_files(script: str, tmp_path: Path) -> None:
    (tmp_path / "a tree.yaml").touch()
    offered = bash_completes(script, "bt-actions", "run", f"{tmp_path}/a")
    assert offered == [f"{tmp_path}/a tree.yaml"]


@pytest.mark.parametrize("script", ["zsh", "fish"], indirect=True)
def test_the_other_shells_scripts_name_every_command_and_option(script: str) -> None:
    for name, parser in build_parser().commands.items():
        assert name in script
        for action in parser._actions:
            for option in action.option_strings:
                assert option.lstrip("-") in script, option


@pytest.mark.parametrize("script", ["zsh", "fish"], indirect=True)
def test_the_other_shells_can_read_their_scripts(
    script: str, request: pytest.FixtureRequest
) -> None:
    shell = request.node.callspec.params["script"]
    if shutil.which(shell) is None:
        pytest.skip(f"needs {shell}")
    subprocess.run([shell, "-n"], input=script, text=True, check=True)
