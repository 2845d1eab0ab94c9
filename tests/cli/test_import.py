"""`bt-actions import` writes trees and tells of what is not as it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.cli import main

XML = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
<AlwaysSuccess/>
{more}
</Sequence></BehaviorTree></root>
"""


def run(tmp_path: Path, more: str, *arguments: str) -> int:
    (tmp_path / "main.xml").write_text(XML.format(more=more), encoding="utf-8")
    return main(["import", str(tmp_path / "main.xml"), "-o", str(tmp_path / "trees"), *arguments])


def test_a_tree_is_written_and_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, "<Sleep msec='1'/>") == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"3 nodes: 3 converted; 1 files in {tmp_path / 'trees'}\n"
    assert main(["check", str(tmp_path / "trees" / "Main.yaml")]) == 0


def test_what_is_refused_is_told_and_is_the_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "<SingleTrigger><AlwaysSuccess/></SingleTrigger>") == 1
    out, _ = capsys.readouterr()
    assert out.startswith(f"{tmp_path / 'main.xml'}:3:1: node SingleTrigger: refused: the node")
    assert "AlwaysSuccess: converted" not in out


def test_the_report_tells_of_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, "", "--report") == 0
    out, _ = capsys.readouterr()
    assert "main.xml:2:1: node AlwaysSuccess: converted\n" in out


def test_classes_that_were_written_meanwhile_stay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "<OpenDoor/>") == 0
    classes = tmp_path / "trees" / "leaves_to_write.py"
    classes.write_text("# written\n", encoding="utf-8")
    capsys.readouterr()
    assert run(tmp_path, "<OpenDoor/><CloseDoor/>") == 0
    assert classes.read_text(encoding="utf-8") == "# written\n"
    assert "leaves_to_write.py exists, and stays as it is" in capsys.readouterr().err
    assert "CloseDoor" in (tmp_path / "trees" / "Main.yaml").read_text(encoding="utf-8")


def test_where_a_file_cannot_be_read_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "<Sequence>") == 2
    _, err = capsys.readouterr()
    assert err == f"{tmp_path / 'main.xml'}:4:14: mismatched tag\n"
    assert not (tmp_path / "trees").exists()


def test_a_map_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "", "--map", str(tmp_path / "map.yaml")) == 2
    assert "map.yaml: this cannot be read: No such file" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "trees").write_text("", encoding="utf-8")
    assert run(tmp_path, "") == 2
    assert "cannot be written: File exists" in capsys.readouterr().err
