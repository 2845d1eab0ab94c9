"""Numbers given to a tree are finite, however they are given."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.cli import main
from bt_actions.document import InputError, check_file, check_source, load_tree, source_of

DEFAULT = "tree: t\ninputs: {{a: {{type: {type}, default: {value}}}}}\nroot: {{check: $a == $a}}\n"


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf", "[1.0, .nan]"])
def test_set_refuses_a_number_that_is_not_finite(
    value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = '"float64[]"' if value.startswith("[") else "float64"
    path = tmp_path / "t.yaml"
    path.write_text(f"tree: t\ninputs: {{a: {kind}}}\nroot: {{check: $a == $a}}\n")
    assert main(["run", str(path), "--set", f"a={value}"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"bt-actions: --set a={value}: a finite number is needed, not "), said
    assert said.count("\n") == 1


def test_a_caller_s_value_is_refused_too(tmp_path: Path) -> None:
    path = tmp_path / "t.yaml"
    path.write_text("tree: t\ninputs: {a: float64}\nroot: {check: $a > 0}\n")
    with pytest.raises(InputError, match="finite"):
        load_tree(path, {"a": float("nan")})


@pytest.mark.parametrize(("kind", "value"), [("float64", ".nan"), ('"float64[]"', "[.inf]")])
def test_a_default_that_is_not_finite_is_found_by_check(kind: str, value: str) -> None:
    text = DEFAULT.format(type=kind, value=value)
    [finding] = check_source(source_of(text.encode(), "t.yaml"))
    assert (finding.code, finding.line) == ("BT110", 2)
    assert "a finite number is needed" in finding.message


@pytest.mark.parametrize(
    ("kind", "value"), [("float64", ".inf"), ("float64", "-.inf"), ('"float64[]"', "[1.0, .nan]")]
)
def test_a_subtree_s_input_that_is_not_finite_is_found_by_check(
    kind: str, value: str, tmp_path: Path
) -> None:
    (tmp_path / "in.yaml").write_text(
        f"tree: in\ninputs: {{a: {kind}}}\nroot: {{check: $a == $a}}\n"
    )
    path = tmp_path / "t.yaml"
    path.write_text(f"tree: t\nroot: {{subtree: in.yaml, with: {{a: {value}}}}}\n")
    [finding] = check_file(path)
    assert (finding.code, finding.line) == ("BT110", 2)
    assert "a finite number is needed" in finding.message


def test_an_input_that_is_set_twice_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--set", "pick_at=1", "--set", "pick_at=2"]
    assert main(["run", "pick_and_place", *given]) == 2
    assert "--set pick_at is given twice: '1' and '2'" in capsys.readouterr().err
