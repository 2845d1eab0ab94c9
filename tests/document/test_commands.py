"""`check`, `explain`, `schema` and `format` on the command line, and the forms of a report."""

from __future__ import annotations

import errno
import io
import json
import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from bt_actions.cli import main
from bt_actions.document import check_file, check_source, source_of
from bt_actions.document.findings.reports import as_json, as_text

WRONG = """\
tree: t
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 30 s}
root:
  sequence: S
  children:
    - move: A
      goal: {distnace: 2.0}
    - check: $x = 1
"""
TEXT = """\
t.yaml:8:14: error[BT203]: MoveRobot.Goal has no field 'distnace'; did you mean 'distance'?
 8 |       goal: {distnace: 2.0}
   |              ^^^^^^^^
t.yaml:9:17: error[BT114]: '=' alone compares nothing: write '=='
 9 |     - check: $x = 1
   |                 ^
2 errors; `bt-actions explain CODE` says more
"""


def findings() -> list[Any]:
    return list(check_source(source_of(WRONG.encode(), "t.yaml")))


def test_the_text_reads_like_a_compiler_s() -> None:
    assert as_text(findings()) == TEXT
    assert as_text([]) == ""


def test_people_are_told_errors_first_and_tools_by_place() -> None:
    text = (
        "tree: t\ndescription: “x”\nroot:\n  sequence: S\n  children:\n"
        "    - {wait: 500}\n    - {log: $b}\n    - {log: $c}\n"
    )
    found = check_source(source_of(text.encode(), "t.yaml"))
    told = re.findall(r"t\.yaml:(\d+):\d+: (\w+)", as_text(found))
    assert told == [("7", "error"), ("8", "error"), ("2", "warning"), ("6", "warning")]
    assert [each["line"] for each in json.loads(as_json(found))] == [2, 6, 7, 8]


def test_json_is_a_list_of_objects() -> None:
    first = json.loads(as_json(findings()))[0]
    assert first == {
        "file": "t.yaml", "line": 8, "column": 14, "end_line": 8, "end_column": 22,
        "code": "BT203", "severity": "error",
        "message": "MoveRobot.Goal has no field 'distnace'; did you mean 'distance'?",
    }  # fmt: skip


@pytest.fixture
def wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "t.yaml"
    path.write_text(WRONG)
    return path


@pytest.mark.usefixtures("wrong")
def test_check_exits_with_1_when_something_was_found(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "t.yaml"]) == 1
    assert capsys.readouterr().out == TEXT


def test_check_exits_with_0_when_all_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "pick_and_place", "recover"]) == 0
    assert capsys.readouterr().out == ""


def test_check_exits_with_2_when_a_file_cannot_be_read(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["check", "recover", "no_such.yaml"]) == 2
    assert "no_such.yaml:1:1: error[BT100]: there is no" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["check", "run", "render", "format"])
def test_without_libyaml_no_command_guesses_what_a_tree_says(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("yaml.__with_libyaml__", False)
    assert main([command, "trees/recover.yaml"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("bt-actions: trees are read with libyaml, and PyYAML is installed")


@pytest.mark.usefixtures("wrong")
def test_check_tells_what_two_trees_share_only_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["check", "--format", "json", "t.yaml", "t.yaml"]) == 1
    assert len(json.loads(capsys.readouterr().out)) == 2


class _Stdin:
    def __init__(self, data: bytes) -> None:
        self.buffer = io.BytesIO(data)


def test_check_reads_standard_input(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", _Stdin(WRONG.encode()))
    assert main(["check", "--no-types", "-"]) == 1
    assert capsys.readouterr().out.startswith("<stdin>:9:17: error[BT114]")


@pytest.mark.parametrize("command", ["check", "format"])
def test_standard_input_that_is_closed_is_told(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", None)
    assert main([command, "-"]) == 2
    said = capsys.readouterr()
    assert "<stdin>:1:1: error[BT100]: this is closed" in said.out + said.err


@pytest.mark.parametrize("command", ["check", "format"])
def test_standard_input_is_read_within_bounds(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Path("/dev/zero").open() as endless:
        monkeypatch.setattr("sys.stdin", endless)
        assert main([command, "-"]) == 2
    said = capsys.readouterr()
    assert "<stdin>:1:1: error[BT100]: this is larger than 32 MiB" in said.out + said.err


@pytest.mark.parametrize("command", ["check", "run", "render", "format"])
def test_an_empty_name_is_told(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, ""]) == 2
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
    assert said.out + said.err != ""


def test_explain_prints_a_page_or_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "bt203"]) == 0
    assert capsys.readouterr().out.startswith("BT203: a message has no such field (error)")
    assert main(["explain"]) == 0
    assert "BT301  warning  no result timeout\n" in capsys.readouterr().out
    assert main(["explain", "BT2033"]) == 2
    assert "no rule 'BT2033'; did you mean 'BT203'?" in capsys.readouterr().err


def test_format_rewrites_files_and_check_changes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "t.yaml"
    path.write_text("root: {success: A}\ntree: t\n")
    assert main(["format", "--check", str(path)]) == 1
    assert path.read_text() == "root: {success: A}\ntree: t\n"
    assert main(["format", str(path)]) == 0
    assert path.read_text() == "tree: t\nroot: {success: A}\n"
    assert main(["format", "--check", str(path)]) == 0
    assert "would change" in capsys.readouterr().err


@pytest.mark.parametrize(("where", "fails"), [(os, "fchmod"), (Path, "replace")])
def test_format_leaves_nothing_behind_where_it_cannot_write(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    where: object,
    fails: str,
) -> None:
    def fail(*_args: object) -> None:
        raise OSError(errno.EDQUOT, "Disk quota exceeded")

    path = tmp_path / "t.yaml"
    path.write_text("root: {success: A}\ntree: t\n")
    monkeypatch.setattr(where, fails, fail)
    assert main(["format", str(path)]) == 2
    assert "t.yaml: cannot be written: Disk quota exceeded" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["t.yaml"]
    assert path.read_text() == "root: {success: A}\ntree: t\n"


def test_a_file_that_cannot_be_formatted_keeps_no_other_from_being(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad, good, worse = (tmp_path / name for name in ("a.yaml", "b.yaml", "c.yaml"))
    bad.write_text("root: [\n")
    good.write_text("root: {success: A}\ntree: t\n")
    assert main(["format", str(bad), str(good), str(worse)]) == 2
    assert (bad.read_text(), good.read_text()) == (
        "root: [\n", "tree: t\nroot: {success: A}\n"
    )  # fmt: skip
    said = capsys.readouterr().err
    assert said.index("error[BT102]") < said.index("b.yaml: formatted") < said.index("[BT100]")


def test_the_problem_matcher_in_the_repository_reads_what_check_writes() -> None:
    path = Path(__file__).resolve().parents[2] / ".github" / "bt-actions-matcher.json"
    pattern = json.loads(path.read_text())["problemMatcher"][0]["pattern"][0]
    match = re.match(pattern["regexp"], TEXT.splitlines()[0])
    assert match is not None
    found = {name: match[number] for name, number in pattern.items() if name != "regexp"}
    assert found == {
        "file": "t.yaml", "line": "8", "column": "14", "severity": "error", "code": "BT203",
        "message": "MoveRobot.Goal has no field 'distnace'; did you mean 'distance'?",
    }  # fmt: skip


def test_the_hooks_for_pre_commit_pass_a_sound_tree_and_no_other(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[2]
    sound, wrong = tmp_path / "sound.yaml", tmp_path / "wrong.yaml"
    sound.write_bytes((root / "trees" / "four_steps.yaml").read_bytes())
    wrong.write_text("tree: t\nroot: {succes: a\n")
    for hook in yaml.safe_load((root / ".pre-commit-hooks.yaml").read_text()):
        command, *arguments = hook["entry"].split()
        assert (command, hook["language"]) == ("bt-actions", "system")
        assert main([*arguments, str(sound)]) == 0
        assert main([*arguments, str(wrong)]) != 0


@pytest.mark.parametrize(
    ("code", "answer"),
    [
        ("BT999", "`bt-actions explain` lists them"),
        ("xyz", "`bt-actions explain` lists them"),
        ("203", "did you mean 'BT203'?"),
    ],
)
def test_an_unknown_rule_suggests_nothing_unrelated(
    code: str, answer: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", code]) == 2
    assert capsys.readouterr().err == f"bt-actions: there is no rule {code!r}; {answer}\n"


def test_a_root_that_is_misspelt_is_one_error_that_names_it() -> None:
    [finding] = check_source(source_of(b"tree: t\nrot: {success: A}\n", "t.yaml"))
    assert finding.message == "unknown key 'rot'; did you mean 'root'?"
    found = check_source(source_of(b"tree: t\nxyzzy: {success: A}\n", "t.yaml"))
    assert any("root" in (finding.hint or "").split(", ") for finding in found)


@pytest.mark.parametrize("width", [40, 80, 200])
@pytest.mark.parametrize("before", [0, 30, 300])
def test_a_long_source_line_is_cut_with_the_caret_under_what_is_meant(
    width: int, before: int
) -> None:
    text = f"tree: t\nroot: {{success: '{'a' * before}', childen: {'b' * 500}}}\n"
    found = check_source(source_of(text.encode(), "t.yaml"))
    finding = next(finding for finding in found if finding.code == "BT107")
    _, source, carets = finding.text(width).splitlines()[:3]
    assert max(len(source), len(carets)) <= width
    assert source[carets.index("^") : carets.rindex("^") + 1] == "childen"


@pytest.mark.parametrize("name", ["a folder", "a device"])
def test_the_place_of_what_is_no_file_stands_there_once(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path if name == "a folder" else Path("/dev/null")
    assert main(["run", str(path)]) == 2
    assert capsys.readouterr().err.count(f"{path}:1:1: error[BT100]: ") == 1


@pytest.mark.parametrize("command", ["check", "run", "render"])
@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("bases.yaml", "; did you mean 'base.yaml'?"),
        ("bases", "; did you mean 'base.yaml'?"),
        ("base.yml", "; did you mean 'base.yaml'?"),
        ("{folder}/bases.yaml", "; did you mean 'base.yaml'?"),
        ("nowhere/base.yaml", ": there is no folder 'nowhere'"),
        ("lost", ": lost.yaml is a link to {folder}/gone.yaml, which is not there"),
        ("lost.yaml", ": lost.yaml is a link to {folder}/gone.yaml, which is not there"),
        ("far/a.yaml", ": far is a link to {folder}/gone, which is not there"),
        ("package://own/trees/a.yaml", "/a.yaml is a link to {folder}/gone, which is not there"),
    ],
)
def test_a_tree_that_is_not_there_is_told_with_what_is_beside_it(
    command: str,
    name: str,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("base.yaml").write_text("tree: base\nroot: {success: }\n")
    Path("lost.yaml").symlink_to("gone.yaml")
    Path("far").symlink_to("gone")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    Path("share/own/trees").mkdir(parents=True)
    Path("share/own/trees/a.yaml").symlink_to("../../../gone")
    assert main([command, name.replace("{folder}", str(tmp_path))]) == 2
    out, err = capsys.readouterr()
    assert (out + err).splitlines()[0].endswith(told.replace("{folder}", str(tmp_path)))


def test_a_subtree_that_is_not_there_is_told_with_the_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own").mkdir()
    monkeypatch.setenv("BT_ACTIONS_TREE_PATH", f"{tmp_path}/own:{tmp_path}/gone")
    (tmp_path / "homing_arm.yaml").write_text("tree: base\nroot: {success: }\n")
    (tmp_path / "t.yaml").write_text("tree: t\nroot: {subtree: homing}\n")
    (finding,) = check_file(tmp_path / "t.yaml")
    assert finding.message.endswith("installed; did you mean 'homing_arm.yaml'?")
    assert f"{finding.hint}, ".startswith(f"looked in {tmp_path}, {tmp_path}/own, ")


def test_data_in_a_link_to_nowhere_is_told(tmp_path: Path) -> None:
    (tmp_path / "points.yaml").symlink_to("gone.yaml")
    (tmp_path / "t.yaml").write_text(
        'tree: t\noutputs: {x: string}\nroot: {set: {x: "@points.yaml"}}\n'
    )
    (first,) = check_file(tmp_path / "t.yaml")
    gone = tmp_path / "gone.yaml"
    assert first.message == f"points.yaml:1:1: this is a link to {gone}, which is not there"
