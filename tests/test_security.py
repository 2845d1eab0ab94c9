"""What docs/security.md promises: a tree runs no code, and the package has no back door."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from bt_actions import load_tree
from bt_actions.cli import main
from bt_actions.document import DocumentError, open_tree
from bt_actions.document.building.build import build
from bt_actions.document.building.context import Scope
from bt_actions.document.reading.workspace import Workspace
from bt_actions.document.yaml.source import MAX_ERRORS

PACKAGE = Path(__file__).parents[1] / "bt_actions"

NEVER_CALLED = {"eval", "exec", "compile", "__import__", "system", "popen", "Popen", "check_output"}
NEVER_IMPORTED = {"pickle", "marshal", "shelve", "subprocess", "pty", "dill"}
RUNS_TOOLS = {room: {"Popen", "subprocess"} for room in ("packages", "recording", "page")}
"""`interfaces build` starts compilers and pip; a long recording is packed, and the page served, by
another Python. No tree leads there."""
_numbers = itertools.count()


@pytest.fixture
def trap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tree that includes one with a `python:` node whose module leaves a mark when imported."""
    mark = tmp_path / "imported"
    module = f"trap_{next(_numbers)}"  # a module is imported once, whatever test asks for it
    (tmp_path / f"{module}.py").write_text(
        "import pathlib, py_trees\n"
        f"pathlib.Path({str(mark)!r}).touch()\n"
        "class Trap(py_trees.behaviours.Success):\n    pass\n"
    )
    (tmp_path / "inner.yaml").write_text(f"tree: inner\nroot: {{python: {module}.Trap}}\n")
    (tmp_path / "outer.yaml").write_text(
        "tree: outer\ninputs: {x: {type: float64, default: 1.0}}\n"
        "root:\n  sequence: Work\n  children:\n    - subtree: inner.yaml\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (["run"], 2),
        (["run", "--set", "x=2.0"], 2),
        (["render"], 2),
        (["check"], 1),
        (["check", "--no-types"], 1),
    ],
)
def test_no_python_refuses_the_tree_and_imports_nothing(
    trap: Path, command: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "--no-python", str(trap / "outer.yaml")]) == code
    told = "".join(capsys.readouterr())
    assert "inner.yaml:2:8: error[BT214]: python: is not allowed here" in told
    assert not (trap / "imported").exists()


def test_check_no_python_holds_for_standard_input(
    trap: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", (trap / "inner.yaml").open())
    assert main(["check", "--no-python", "-"]) == 1
    assert "BT214" in capsys.readouterr().out
    assert not (trap / "imported").exists()


def test_load_tree_refuses_it_as_well_with_and_without_types(trap: Path) -> None:
    for types in (True, False):
        with pytest.raises(DocumentError, match="not allowed"):
            load_tree(trap / "outer.yaml", types=types, python=False)
    assert not (trap / "imported").exists()


@pytest.mark.parametrize("included", [False, True])
def test_no_number_of_warnings_hides_a_python_node(trap: Path, included: bool) -> None:
    node = (trap / "inner.yaml").read_text().partition("root: ")[2]
    text = "tree: t\nroot:\n  sequence: S\n  children:\n"
    text += "    - success: Part #0\n" * (MAX_ERRORS + 10) + f"    - {node}"
    (trap / "many.yaml").write_text(text)
    (trap / "around.yaml").write_text("tree: around\nroot: {subtree: many.yaml}\n")
    with pytest.raises(DocumentError, match="not allowed"):
        load_tree(trap / ("around.yaml" if included else "many.yaml"), python=False)
    assert not (trap / "imported").exists()


def test_building_refuses_what_the_checker_let_through(trap: Path) -> None:
    workspace = Workspace()
    document = workspace.open(trap / "outer.yaml")
    assert document is not None
    build(document, Scope.of_load("outer"), python=False)
    assert [one.code for one in workspace.findings] == ["BT214"]
    assert not (trap / "imported").exists()


def test_without_the_option_it_is_loaded(trap: Path) -> None:
    load_tree(trap / "outer.yaml")
    assert (trap / "imported").exists()


@pytest.mark.parametrize(
    "tag", ["!!python/object/apply:os.system", "!!python/name:os.system", "!x"]
)
def test_a_tag_that_would_construct_something_is_an_error(tmp_path: Path, tag: str) -> None:
    path = tmp_path / "tagged.yaml"
    path.write_text(f"tree: tagged\nroot: {{log: {tag} [echo]}}\n")
    with pytest.raises(DocumentError):
        load_tree(path)


def calls() -> Iterator[tuple[Path, ast.Call]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                yield path, node


def test_a_served_tree_reads_what_lies_or_is_linked_in_its_folders_and_nothing_else(
    tmp_path: Path,
) -> None:
    folder, elsewhere = tmp_path / "trees", tmp_path / "elsewhere.yaml"
    folder.mkdir()
    elsewhere.write_text("tree: elsewhere\nroot: {success: }\n")
    (folder / "linked.yaml").symlink_to(elsewhere)
    tree = folder / "tree.yaml"
    tree.write_text("tree: tree\nroot: {subtree: linked.yaml}\n")
    open_tree(tree, within=[folder])
    for path in ("../elsewhere.yaml", str(elsewhere), "../trees/../elsewhere.yaml"):
        tree.write_text(f"tree: tree\nroot: {{subtree: {path}}}\n")
        with pytest.raises(DocumentError, match="lies outside of the folders"):
            open_tree(tree, within=[folder])


def test_the_package_evaluates_no_text_and_starts_no_command() -> None:
    found = []
    for path, call in calls():
        name = getattr(call.func, "id", None) or getattr(call.func, "attr", "")
        owner = getattr(getattr(call.func, "value", None), "id", "")
        harmless = name == "compile" and owner == "re"
        allowed = RUNS_TOOLS.get(path.parent.name, set())
        if name in NEVER_CALLED - allowed and not harmless:
            found.append(f"{path.name}:{call.lineno} {name}")
        if owner == "yaml" and name in {"load", "load_all", "unsafe_load", "full_load"}:
            found.append(f"{path.name}:{call.lineno} yaml.{name}")
        if any(word.arg == "shell" for word in call.keywords):
            found.append(f"{path.name}:{call.lineno} shell=")
    assert found == []


def test_the_package_imports_nothing_that_unpickles_or_runs_commands() -> None:
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            never = NEVER_IMPORTED - RUNS_TOOLS.get(path.parent.name, set())
            found += [f"{path.name}: {n}" for n in names if n.split(".")[0] in never]
    assert found == []
