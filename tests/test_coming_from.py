"""What the pages for those who come from other tools show of this project is right.

A block of another tool is of another language, or is marked: ```python there.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bt_actions.document import check_file
from tests.support.processes import HostFactory, Process

PAGES = sorted((Path(__file__).resolve().parents[1] / "docs" / "coming_from").glob("*.md"))
OURS = {"yaml", "python", "console"}
THEIRS = {"xml", "cpp", "osc", "python there"}
NOT_INSTALLED = "nav2_msgs"

Start = Callable[..., Process]


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def parts(language: str, *, simulated: bool = False) -> list[object]:
    found = [(page, block) for page in PAGES for block in blocks(page, language)]
    if simulated:
        found = [(page, block) for page, block in found if NOT_INSTALLED not in block]
    return [pytest.param(block, id=f"{page.stem}{at}") for at, (page, block) in enumerate(found)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_page_shows_the_other_tool_and_this_one(page: Path) -> None:
    languages = set(re.findall(r"^```(.+)$", page.read_text(encoding="utf-8"), re.MULTILINE))
    assert languages <= OURS | THEIRS
    assert languages & {"yaml", "python"}
    assert languages & THEIRS


@pytest.mark.parametrize("text", parts("yaml"))
def test_a_tree_on_a_page_has_nothing_wrong(text: str, tmp_path: Path) -> None:
    tree = tmp_path / "tree.yaml"
    tree.write_text(text, encoding="utf-8")
    assert list(check_file(tree, types=NOT_INSTALLED not in text)) == []


@pytest.mark.parametrize("text", parts("yaml", simulated=True))
def test_a_tree_on_a_page_fetches_the_simulated_part(
    text: str, start_program: Start, tmp_path: Path
) -> None:
    tree = tmp_path / "tree.yaml"
    tree.write_text(text, encoding="utf-8")
    program = start_program("-m", "bt_actions.cli", "run", str(tree), "--sim", "--speed", "20")
    assert program.wait() == 0, program
    assert "The part is in the gripper of the robot" in "\n".join(program.lines), program


@pytest.mark.parametrize("code", parts("python"))
def test_a_program_on_a_page_fetches_the_simulated_part(
    code: str, start_program: Start, new_host: HostFactory, tmp_path: Path
) -> None:
    new_host().robot("", speed=20.0)
    script = tmp_path / "program.py"
    script.write_text(code, encoding="utf-8")
    program = start_program(str(script))
    assert program.wait(40.0) == 0, program
    assert program.lines == ["Status.SUCCESS"], program
