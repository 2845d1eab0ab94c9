"""Each rule has a page, and its examples are what they say."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bt_actions.document import RULES, Severity, check_file
from bt_actions.document.findings import rules
from bt_actions.document.findings.hazards import HAZARDS

NOT_SHOWN = {"BT100", "BT101"}
"""What is wrong with a file, and not with its text: their examples are commands."""


def codes(folder: Path, name: str, text: str) -> dict[str, Severity]:
    shutil.copy(Path(__file__).with_name("needs_input.yaml"), folder)
    (folder / name).write_text(text, encoding="utf-8")
    return {finding.code: finding.severity for finding in check_file(folder / name)}


def test_each_code_is_that_of_one_rule() -> None:
    codes = [rule.code for rule in (*rules._RULES, *HAZARDS)]
    assert codes == sorted(set(RULES))


@pytest.mark.parametrize("code", sorted(set(RULES) - NOT_SHOWN))
def test_the_wrong_example_breaks_the_rule_and_no_other(code: str, tmp_path: Path) -> None:
    assert set(codes(tmp_path, "wrong.yaml", RULES[code].wrong)) == {code}


@pytest.mark.parametrize("code", sorted(set(RULES) - NOT_SHOWN))
def test_the_right_example_is_clean(code: str, tmp_path: Path) -> None:
    assert codes(tmp_path, "right.yaml", RULES[code].right) == {}


@pytest.mark.parametrize("code", sorted(NOT_SHOWN))
def test_the_commands_of_a_page_show_the_rule(code: str) -> None:
    def run(command: str) -> tuple[int, str]:
        folder = Path(sys.executable).parent
        environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}
        done = subprocess.run(
            ["sh", "-c", command], env=environment, capture_output=True, text=True
        )
        return done.returncode, done.stdout

    status, said = run(RULES[code].wrong)
    assert (status, f"error[{code}]" in said) == (2, True)
    assert run(RULES[code].right) == (0, "")


def test_a_page_shows_title_text_and_examples() -> None:
    text = RULES["BT203"].page()
    assert text.startswith("BT203: a message has no such field (error)\n")
    assert "    goal: {distnace: 2.0}" in text
    assert "Right:" in text
