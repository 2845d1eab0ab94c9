"""The file of a tree: by a path, or by the name of an installed tree."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from bt_actions.document.yaml.source import broken_link
from bt_actions.utilities.suggest import closest, did_you_mean, listing

_SUFFIXES = (".yaml", ".yml")
_MOST = 4
"""Folders that a message names."""
_SEARCH_PATH = "BT_ACTIONS_TREE_PATH"
_CHECKOUT = Path(__file__).resolve().parents[3] / "trees"
_INSTALLED = Path("share", "bt_actions", "trees")


class TreeNotFoundError(FileNotFoundError):
    """No such tree; the text says what may be meant, and `hint` where trees were looked for."""

    def __init__(self, text: str, hint: str | None = None) -> None:
        super().__init__(text)
        self.hint = hint


def find_tree(name_or_path: str | os.PathLike[str], *, beside: Path | None = None) -> Path:
    """Return a tree's file: by path, `package://pkg/trees/x.yaml`, or an installed tree's name.

    A path is looked for beside `beside` (the folder of an including file) or in the current
    folder; a name then in `BT_ACTIONS_TREE_PATH`, in the checkout's own `trees/`, and in
    `share/<package>/trees` of every installed package. Raises TreeNotFoundError.
    """
    wanted = os.fspath(name_or_path)
    if wanted.startswith("package://"):
        return _in_package(wanted)
    if not wanted:
        raise TreeNotFoundError("the name of a tree is needed, not an empty text")
    path = name_or_path if isinstance(name_or_path, Path) else Path(wanted)
    exact = path if beside is None else beside / path
    if is_file(exact):
        return exact
    endings = ("",) if path.suffix in _SUFFIXES else _SUFFIXES
    candidates = [exact.with_name(path.name + ending) for ending in endings if exact.name]
    is_name = len(path.parts) == 1 and not wanted.startswith(".")
    for folder in tree_folders() if is_name else ():
        candidates += [folder / (path.name + ending) for ending in endings]
    for candidate in candidates:
        if is_file(candidate):
            return candidate
    if _is_there(exact):
        return exact  # the reader will report the folder
    _refuse_links(exact, *candidates)
    raise TreeNotFoundError(_nowhere(wanted, exact, is_name), _searched(exact) if is_name else None)


def tree_folders() -> Iterator[Path]:
    """Yield the folders where trees are looked for by name, in order."""
    for entry in os.environ.get(_SEARCH_PATH, "").split(os.pathsep):
        if entry:
            yield Path(entry)
    yield _CHECKOUT  # an editable install's copies may be old
    for prefix in _prefixes():
        yield prefix / _INSTALLED
        for package in _packages(prefix):
            if package != "bt_actions":
                yield prefix / "share" / package / "trees"


def own_folders() -> list[Path]:
    """Return the folders of what comes with bt_actions: trees, and words to import."""
    return [_CHECKOUT, *(prefix / _INSTALLED for prefix in _prefixes())]


def tree_folder(place: str | os.PathLike[str]) -> Path:
    """Return a folder of trees: a path, or `package://pkg/trees`. Raises TreeNotFoundError."""
    wanted = os.fspath(place)
    if not wanted.startswith("package://"):
        return Path(wanted)
    for candidate in _places(wanted):
        if candidate.is_dir():
            return candidate
    raise TreeNotFoundError(f"there is no folder {wanted!r}: it is written package://pkg/trees")


def installed_trees() -> dict[str, Path]:
    """Return every tree that has a name, with its file."""
    found: dict[str, Path] = {}
    for folder in tree_folders():
        try:
            files = sorted(folder.iterdir())
        except OSError:
            continue
        for file in files:
            if is_tree_file(file):
                found.setdefault(file.stem, file)
    return found


def _prefixes() -> Iterator[Path]:
    seen = set()
    for entry in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        if entry and entry not in seen:
            seen.add(entry)
            yield Path(entry)


def _packages(prefix: Path) -> list[str]:
    """Return the packages of a prefix, from the ament index."""
    try:
        index = prefix / "share" / "ament_index" / "resource_index" / "packages"
        return sorted(entry.name for entry in index.iterdir())
    except OSError:
        return []


def _places(wanted: str) -> list[Path]:
    """Return the paths that a place in a package may have."""
    package, _, inner = wanted.removeprefix("package://").partition("/")
    if not package or ".." in Path(inner).parts:
        return []
    return [prefix / "share" / package / inner for prefix in _prefixes()]


def _in_package(wanted: str) -> Path:
    package, _, inner = wanted.removeprefix("package://").partition("/")
    places = _places(wanted)
    if not inner or not places:
        raise TreeNotFoundError(f"{wanted!r} is no place: it is written package://pkg/trees/x.yaml")
    for candidate in places:
        if is_file(candidate):
            return candidate
    _refuse_links(*places)
    near = next(filter(None, map(_beside, places)), "")
    raise TreeNotFoundError(f"there is no {inner!r} in the package {package!r}{near}")


def _refuse_links(*places: Path) -> None:
    """Raise TreeNotFoundError for a link to nowhere, or a folder that is one."""
    for place in places:
        for path in (place, place.parent):
            if link := broken_link(path):
                raise TreeNotFoundError(f"{path} is {link}")


def is_file(path: Path) -> bool:
    """Return whether a path leads to a file, as far as the system tells."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _is_there(path: Path) -> bool:
    """Return whether something has this path, or the system cannot tell (a name too long)."""
    try:
        return path.exists()
    except OSError:
        return True


def _nowhere(wanted: str, exact: Path, is_name: bool) -> str:
    if not is_name:
        folder = "" if exact.parent.is_dir() else f": there is no folder {str(exact.parent)!r}"
        return f"there is no tree {str(exact)!r}{folder or _beside(exact)}"
    text = f"there is no tree {wanted!r} here, and none of that name is installed"
    return text + (_beside(exact) or did_you_mean(Path(wanted).stem, installed_trees()))


def _beside(path: Path) -> str:
    """Return the tree beside a missing path that may be meant."""
    try:
        there = sorted(path.parent.iterdir())
        files = {each.stem: each.name for each in there if is_tree_file(each)}
    except (OSError, ValueError):
        return ""
    near = path.stem if path.stem in files else closest(path.stem, files)
    return f"; did you mean {files[near]!r}?" if near else ""


def _searched(exact: Path) -> str:
    """Say where a name was looked for."""
    folders = [exact.parent.absolute(), *(each for each in tree_folders() if each.is_dir())]
    return f"looked in {listing(dict.fromkeys(map(str, folders)), _MOST)}"


def is_tree_file(path: Path) -> bool:
    """Return whether a file is a tree's, by its name."""
    return path.suffix in _SUFFIXES and not path.name.startswith(".")
