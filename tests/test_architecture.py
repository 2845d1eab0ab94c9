"""The arrows of docs/architecture.md: which room may import which, read off the source.

Imports for type checkers count as well. What does not hold yet stands in a list of exceptions,
which only shrinks: one that is needed no more has to go.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import bt_actions
from bt_actions import traffic

ROOT = Path(bt_actions.__file__).parent
ROOMS = [
    {"cli"},
    {"page", "serving", "testing"},
    {"importing", "recording", "render", "running", "simulation"},
    {"document"},
    {"behaviours"},
    {"wiring"},
    {"recovery"},
    {"ros"},
    {"traffic"},
    {"messages", "expressions", "servers"},
    {"story"},
    {"events"},
    {"goals", "packages"},
    {"utilities"},
]
"""From above to below: a room imports from the rows below its own, never from beside or above."""
ROOMS_OF_DOCUMENT = [
    {""},
    {"formatting"},
    {"kinds"},
    {"building", "checking"},
    {"reading"},
    {"language"},
    {"yaml"},
    {"findings"},
]
"""The same inside of document/; "" are the files in no room."""
CORE = {"goals", "servers", "traffic", "behaviours", "running"}
"""Rooms that know ROS by wiring.py alone."""
WRONG_ARROWS: set[tuple[str, str]] = set()
"""Those that are to go: the core is to know ROS through a seam alone."""
MAY_IMPORT_RCLPY = ("ros/", "simulation/ros/")
STRAYS: set[str] = set()
"""Files outside these rooms that import rclpy."""
FILES = sorted(ROOT.rglob("*.py"))
LONGEST, MOST_FILES = 500, 20
LONG: set[str] = set()
"""Files of more lines than LONGEST."""
CROWDED: set[str] = set()
"""Folders of more files than MOST_FILES."""
CIRCLES: list[set[str]] = []
"""Files that import each other, round about or not."""


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def room_of(file: str) -> str:
    """The room of a file; wiring.py is one, and "" is the package's own namespace."""
    return "wiring" if file == "wiring.py" else file.split("/")[0] if "/" in file else ""


MODULES = {
    ".".join(["bt_actions", *path.relative_to(ROOT).with_suffix("").parts]).removesuffix(
        ".__init__"
    ): name_of(path)
    for path in FILES
}


def imports(path: Path) -> Iterator[str]:
    """The modules that a file imports, wherever in the file that stands."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None, "no relative imports"
            full = [f"{node.module}.{each.name}" for each in node.names]
            yield from (each if each in MODULES else node.module for each in full)


GRAPH = {
    name_of(path): {MODULES[each] for each in imports(path) if each in MODULES} for path in FILES
}


def test_every_file_is_in_a_room() -> None:
    rooms = [room for row in ROOMS for room in row]
    assert {room_of(file) for file in GRAPH} == {"", *rooms}
    assert {file for file in GRAPH if room_of(file) == ""} == {"__init__.py"}


def test_the_arrows_point_down() -> None:
    row = {room: number for number, rooms in enumerate(ROOMS) for room in rooms}
    arrows = {
        (room_of(file), room_of(other))
        for file in GRAPH
        for other in GRAPH[file]
        if room_of(file) and room_of(other)
    }
    wrong = {(a, b) for a, b in arrows if a != b and row[b] <= row[a]}
    assert wrong | {(a, b) for a, b in arrows if a in CORE and b == "ros"} == WRONG_ARROWS
    texts = {name_of(path): path.read_text() for path in FILES if room_of(name_of(path)) in CORE}
    assert not [file for file, text in texts.items() if "import_module" in text]


def test_the_arrows_inside_of_document_point_down() -> None:
    row = {room: number for number, rooms in enumerate(ROOMS_OF_DOCUMENT) for room in rooms}
    inside = {
        file: room_of(file.removeprefix("document/"))
        for file in GRAPH
        if room_of(file) == "document"
    }
    assert set(inside.values()) == set(row)
    arrows = {
        (file, other)
        for file, room in inside.items()
        for other in GRAPH[file] & inside.keys()
        if room != inside[other] and row[inside[other]] <= row[room]
    }
    assert arrows == set()


def test_a_script_of_a_page_has_300_lines_at_most() -> None:
    long = [path for path in ROOT.rglob("*.js") if len(path.read_text().splitlines()) > 300]
    assert long == []


def test_rclpy_stays_in_its_rooms() -> None:
    users = {
        name_of(path)
        for path in FILES
        if any(module.split(".")[0] == "rclpy" for module in imports(path))
    }
    strays = {file for file in users if not file.startswith(MAY_IMPORT_RCLPY)}
    assert strays == STRAYS


def test_each_public_name_is_there_and_exported_once() -> None:
    names = bt_actions.__all__
    assert len(names) == len(set(names))
    assert all(hasattr(bt_actions, name) for name in names)
    seen = {*names, "wiring"}
    modules = [name for name in vars(bt_actions) if name[:1] != "_" and name not in seen]
    assert all((ROOT / name).exists() for name in modules), modules


def circles() -> list[set[str]]:
    """The files that can be reached from each other by imports of any kind."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = list(GRAPH[start] - {start})
        while waiting:
            if (file := waiting.pop()) not in seen:
                seen.add(file)
                waiting.extend(GRAPH[file])
        return seen

    far = {file: reached(file) for file in GRAPH}
    rings = {frozenset(other for other in far[file] if file in far[other]) for file in GRAPH}
    return sorted((set(ring) for ring in rings if len(ring) > 1), key=min)


def test_no_files_import_each_other() -> None:
    assert circles() == CIRCLES


def test_the_files_of_traffic_import_those_that_its_head_names_before_them() -> None:
    _, _, below_to_above = (traffic.__doc__ or "").partition("From below to above")
    order = [f"traffic/{name}" for name in re.findall(r"\w+\.py", below_to_above)]
    assert {"traffic/__init__.py", *order} == {file for file in GRAPH if room_of(file) == "traffic"}
    for at, file in enumerate(order):
        assert not GRAPH[file] & set(order[at:])


def test_no_file_is_long() -> None:
    long = {name_of(path) for path in FILES if path.read_text().count("\n") > LONGEST}
    assert long == LONG


def test_no_folder_is_crowded() -> None:
    sizes = Counter(name_of(path.parent) for path in FILES if path.name != "__init__.py")
    assert {folder for folder, size in sizes.items() if size > MOST_FILES} == CROWDED
