"""The arrows of docs/architecture.md: which part may import which, read off the source."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import bt_actions

ROOT = Path(bt_actions.__file__).parent
PARTS = [
    {"cli"},
    {"serving"},
    {"render", "run_report"},
    {"document", "runner", "simulation"},
    {"behaviours"},
    {"ros"},
    {"twin"},
    {"attempts", "testimony", "ledger", "roll_call"},
    {"goal", "resources", "server", "hearing", "standstill", "goal_ids"},
    {"deadlines"},
    {"goal_terms"},
    {"policy"},
]
"""From above to below: a part imports from the rows below its own, never from beside or above."""
TOOLS = {
    "events",
    "expression",
    "expression_text",
    "expression_values",
    "plain_text",
    "shorten",
    "streams",
    "suggest",
    "ticking",
    "units",
    "whole_file",
}
"""Small modules that anybody may import; they import no part but behaviours' and policy's names."""
MAY_IMPORT_RCLPY = {"ros", "serving", "simulation"}
FILES = sorted(ROOT.rglob("*.py"))


def part_of(module: str) -> str:
    """The part that a module of ours belongs to; "" is the package's own namespace."""
    words = module.split(".")
    return words[1] if len(words) > 1 else ""


def imports(path: Path) -> Iterator[str]:
    """The modules that a file imports when it runs, wherever in the file that stands."""
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None, "no relative imports"
            yield node.module
            yield from (f"{node.module}.{each.name}" for each in node.names)
        waiting.extend(ast.iter_child_nodes(node))


def row(part: str) -> int:
    return next(number for number, parts in enumerate(PARTS) if part in parts)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_arrows_point_one_way(path: Path) -> None:
    own = path.relative_to(ROOT).with_suffix("").parts[0]
    for module in imports(path):
        if module.split(".")[0] == "rclpy":
            assert own in MAY_IMPORT_RCLPY, f"{own} imports {module}"
        if module.split(".")[0] != "bt_actions" or own == "__init__":
            continue
        part = part_of(module)
        if part == own or (not (ROOT / part).exists() and not (ROOT / f"{part}.py").exists()):
            continue
        if part in TOOLS or part == "":
            continue
        if own in TOOLS:
            assert part in {"behaviours", "policy"}, f"{own} imports {module}"
            continue
        assert row(part) > row(own), f"{own} imports {module}"


def test_every_module_has_its_place() -> None:
    placed = set().union(*PARTS) | TOOLS | {"__init__", "__main__"}
    here = {path.relative_to(ROOT).with_suffix("").parts[0] for path in FILES}
    assert here <= placed | {"__pycache__"}, here - placed


def test_each_public_name_is_there_and_exported_once() -> None:
    names = bt_actions.__all__
    assert len(names) == len(set(names))
    assert all(hasattr(bt_actions, name) for name in names)
    modules = [name for name in vars(bt_actions) if name[:1] != "_" and name not in names]
    assert all((ROOT / name).exists() or (ROOT / f"{name}.py").exists() for name in modules), (
        modules
    )
