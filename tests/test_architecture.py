"""The arrows of docs/architecture.md: which part may import which, read off the source.

What does not hold yet stands in a list of exceptions, which only shrinks: one that is needed no
more has to go. For circles of files the imports for type checkers count as well.
"""

from __future__ import annotations

import ast
from collections import Counter
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
LONGEST, MOST_FILES = 400, 20
LONG = {
    "behaviours/action.py",
    "document/model.py",
    "document/nodes.py",
    "document/pages.py",
    "document/read.py",
    "goal.py",
    "recovery/sweep.py",
    "ros/line.py",
    "ros/traffic.py",
    "runner.py",
    "serving/server.py",
}
"""Files of more lines than LONGEST."""
CROWDED = {"cli", "document", "ros"}
"""Folders of more files than MOST_FILES."""
CIRCLES: list[set[str]] = [
    {"cli/__init__.py", "cli/completion.py"},
    {"cli/common.py", "cli/ros_arguments.py"},
    {
        "document/check.py",
        "document/check_actions.py",
        "document/check_kinds.py",
        "document/writes.py",
    },
    {"document/nodes.py", "document/source.py", "document/syntax.py"},
    {
        "ros/action_client.py",
        "ros/alarm.py",
        "ros/clocks.py",
        "ros/draining.py",
        "ros/line.py",
        "ros/lookout.py",
        "ros/past.py",
        "ros/shared.py",
        "ros/traffic.py",
        "ros/way.py",
    },
    {"recovery/sweep.py", "recovery/unanswered.py"},
]
"""Files that import each other, round about or not."""


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


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def circles() -> list[set[str]]:
    """The files that can be reached from each other by imports of any kind."""
    modules = {
        ".".join(["bt_actions", *path.relative_to(ROOT).with_suffix("").parts]).removesuffix(
            ".__init__"
        ): name_of(path)
        for path in FILES
    }
    graph: dict[str, set[str]] = {}
    for path in FILES:
        found: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {each.name for each in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                full = {f"{node.module}.{each.name}" for each in node.names}
                found |= {each if each in modules else node.module for each in full}
        graph[name_of(path)] = {modules[each] for each in found if each in modules}

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = list(graph[start] - {start})
        while waiting:
            if (file := waiting.pop()) not in seen:
                seen.add(file)
                waiting.extend(graph[file])
        return seen

    far = {file: reached(file) for file in graph}
    rings = {frozenset(other for other in far[file] if file in far[other]) for file in graph}
    return sorted((set(ring) for ring in rings if len(ring) > 1), key=min)


def test_no_files_import_each_other() -> None:
    assert circles() == CIRCLES


def test_no_file_is_long() -> None:
    long = {name_of(path) for path in FILES if path.read_text().count("\n") > LONGEST}
    assert long == LONG


def test_no_folder_is_crowded() -> None:
    sizes = Counter(name_of(path.parent) for path in FILES if path.name != "__init__.py")
    assert {folder for folder, size in sizes.items() if size > MOST_FILES} - {"."} == CROWDED
