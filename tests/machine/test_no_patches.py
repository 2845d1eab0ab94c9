"""Outside test_mutations.py production is driven as it is: nothing of it is replaced or assigned.

Read off the syntax tree: only an attribute that a class of this folder declares may be assigned.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
TREES = {path.name: ast.parse(path.read_text(encoding="utf-8")) for path in HERE.glob("*.py")}
PATCHING = {"setattr", "delattr", "setitem", "monkeypatch", "MonkeyPatch", "mock", "__dict__"}


def targets(tree: ast.AST) -> Iterator[ast.expr]:
    """What is assigned to, or deleted, anywhere."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.Delete):
            yield from node.targets
        elif isinstance(node, ast.AugAssign | ast.AnnAssign):
            yield node.target


def attributes(tree: ast.AST) -> Iterator[ast.Attribute]:
    """Those of an object, also in a tuple, and those whose items are set."""
    for target in targets(tree):
        for each in target.elts if isinstance(target, ast.Tuple) else [target]:
            while isinstance(each, ast.Subscript | ast.Starred):
                each = each.value
            if isinstance(each, ast.Attribute):
                yield each


def is_self(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id == "self"


def declared() -> set[str]:
    """The attributes that classes of this folder give their own objects."""
    names = {"settings", "__name__"}  # of hypothesis, and of a function
    for tree in TREES.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                body = [each for each in node.body if isinstance(each, ast.Assign | ast.AnnAssign)]
                names |= {t.id for each in body for t in targets(each) if isinstance(t, ast.Name)}
        names |= {each.attr for each in attributes(tree) if is_self(each.value)}
    return names


@pytest.mark.parametrize("file", sorted(TREES.keys() - {"test_mutations.py", "test_no_patches.py"}))
def test_production_is_not_patched_in(file: str) -> None:
    tree, ours, imported = TREES[file], declared(), set[str]()
    foreign = [
        ast.unparse(each)
        for each in attributes(tree)
        if not is_self(each.value) and each.attr not in ours
    ]
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute | ast.arg):
            name = getattr(node, "id", getattr(node, "attr", getattr(node, "arg", None)))
            if name in PATCHING:
                foreign.append(ast.unparse(node))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("bt_actions"):
            imported |= {alias.asname or alias.name for alias in node.names}
    roots = {ast.unparse(each.value).split(".")[0] for each in attributes(tree)}
    assert not foreign
    assert not roots & imported
