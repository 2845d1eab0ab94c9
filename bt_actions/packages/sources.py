"""An interface package as it stands: its package.xml, its files, and the types they use.

Mistakes are refused here, with their lines: rosidl would tell of them in the middle of a
long build, and in words of its own.
"""

from __future__ import annotations

import contextlib
import io
import re
import xml.etree.ElementTree as ET  # nosec B405
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from bt_actions.packages import PackageError

KINDS = ("action", "msg", "srv")
_PARTS = {"action": 3, "srv": 2, "msg": 1}
"""How many messages a file of the kind holds, with `---` between them."""
_NAMED = re.compile(r"\b((?:action|msg|srv)/\w+\.(?:action|msg|srv|idl))\b")
_INCLUDE = re.compile(r'^\s*#include\s+"(\w+)/(msg|srv|action)/(\w+)\.idl"', re.MULTILINE)
_DEPENDS = {"depend", "build_depend", "exec_depend", "build_export_depend"}


@dataclass(frozen=True, slots=True)
class Package:
    """A package that can be generated."""

    folder: Path
    name: str
    version: str
    description: str
    license: str
    files: tuple[str, ...]
    """Their paths in the folder: "action/Fetch.action"."""
    uses: dict[str, str]
    """The messages that the files use, "geometry_msgs/Pose", each with its first place."""
    depends: frozenset[str]
    """The dependencies in package.xml, interface packages or not."""

    @property
    def messages(self) -> set[str]:
        """The names of its own messages."""
        return {Path(file).stem for file in self.files if file.startswith("msg/")}

    def __str__(self) -> str:
        return f"{self.name} {self.version}"


def read_package(folder: Path) -> Package:
    """Read the package in `folder`. Raises PackageError, which names the file and the line."""
    manifest = read_manifest(folder)
    name, version = _text(manifest, "name"), _text(manifest, "version")
    where = folder / "package.xml"
    if not re.fullmatch(r"[a-z]([a-z0-9]|_(?!_))*(?<!_)", name):
        raise PackageError(
            f"{where}: <name> is {name!r}: a name has small letters, digits and single _, no digit "
            "first"
        )
    if not re.fullmatch(r"\d+\.\d+\.\d+", version):
        raise PackageError(f"{where}: <version> is {version!r}: it is three numbers, as in 1.2.0")
    files = _files(folder)
    uses: dict[str, str] = {}
    graph: dict[str, set[str]] = {}
    for file in files:
        of_file = _uses(name, folder, file)
        uses = of_file | uses
        if file.startswith("msg/"):
            graph[f"{name}/{Path(file).stem}"] = set(of_file)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = " holds ".join(reversed(error.args[1]))
        raise PackageError(f"{folder}: a message cannot hold itself: {circle}") from error
    return Package(
        folder=folder,
        name=name,
        version=version,
        description=" ".join(_text(manifest, "description").split()),
        license=_text(manifest, "license"),
        files=files,
        uses=uses,
        depends=frozenset((each.text or "").strip() for each in manifest if each.tag in _DEPENDS),
    )


def read_manifest(folder: Path) -> ET.Element:
    """Return the content of package.xml. Raises PackageError."""
    path = folder / "package.xml"
    try:
        return ET.fromstring(path.read_bytes())  # nosec B314
    except FileNotFoundError:
        inside = sorted(each.parent.name for each in folder.glob("*/package.xml"))
        hint = f"; name one of those in it: {', '.join(inside)}" if inside else ""
        there = "is no package: it has no package.xml" if folder.is_dir() else "is no folder"
        raise PackageError(f"{folder} {there}{hint}") from None
    except (OSError, ValueError, ET.ParseError) as error:
        raise PackageError(f"{path} cannot be read: {error}") from error


def _text(manifest: ET.Element, tag: str) -> str:
    return (manifest.findtext(tag) or "").strip()


def _files(folder: Path) -> tuple[str, ...]:
    """Return the files that CMakeLists.txt names; all files where it names none."""
    there = {
        str(path.relative_to(folder))
        for kind in KINDS
        for path in (folder / kind).glob("*")
        if path.suffix in (f".{kind}", ".idl")
    }
    if not there:
        raise PackageError(
            f"{folder} is no interface package: it has no file action/*.action, msg/*.msg or "
            "srv/*.srv"
        )
    cmake = folder / "CMakeLists.txt"
    try:
        text = re.sub(r"#.*", "", cmake.read_text(encoding="utf-8"))
    except FileNotFoundError:
        text = ""
    named = set(_NAMED.findall(text))
    missing = sorted(named - there)
    if missing:
        raise PackageError(f"{cmake} names {missing[0]}, and there is no such file")
    return tuple(sorted(named or there))


def _uses(package: str, folder: Path, file: str) -> dict[str, str]:
    """Return the messages that a file uses, with their places. Raises PackageError."""
    path = folder / file
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", path.stem):
        raise PackageError(
            f"{path}: {path.stem!r} is no name of an interface: a capital first, then letters and "
            "digits, as in FetchCrate"
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise PackageError(f"{path} cannot be read: {error}") from error
    if path.suffix == ".idl":
        found = _INCLUDE.findall(text)
        return {f"{owner}/{name}": str(path) for owner, kind, name in found if kind == "msg"}
    kind = file.split("/")[0]
    lines = text.splitlines()
    parts = [number for number, line in enumerate(lines) if line == "---"]
    if len(parts) + 1 != _PARTS[kind]:
        has, needs = len(parts), _PARTS[kind] - 1
        raise PackageError(
            f"{path}: it has {has or 'no'} {'line' if has == 1 else 'lines'} ---, and a .{kind} "
            f"file has {needs or 'none'}"
        )
    uses: dict[str, str] = {}
    seen: set[str] = set()
    for number, line in enumerate(lines):
        if number in parts:
            seen = set()
            continue
        place = f"{path}:{number + 1}"
        for used, name in _read_line(package, line, place):
            if name in seen:
                raise PackageError(f"{place}: {name!r} is there twice")
            seen.add(name)
            if used is not None:
                uses.setdefault(used, place)
    return uses


def _read_line(package: str, line: str, place: str) -> list[tuple[str | None, str]]:
    """Return the names of a line's field or constants, each with the message that it uses."""
    from rosidl_adapter.parser import InvalidFieldDefinition, parse_message_string

    if line[:1].isspace() and line.strip() and not line.lstrip().startswith("#"):
        raise PackageError(f"{place}: a field begins its line, without spaces before it")
    try:
        # Its complaints go to standard error besides.
        with contextlib.redirect_stderr(io.StringIO()):
            spec = parse_message_string(package, "Line", line)
    except InvalidFieldDefinition as error:
        raise PackageError(f"{place}: {str(error).strip()!r} has a type and no name") from error
    except Exception as error:  # the parser raises what it likes
        raise PackageError(f"{place}: {error}") from error
    found: list[tuple[str | None, str]] = [(None, constant.name) for constant in spec.constants]
    for field in spec.fields:
        owner = field.type.pkg_name
        found.append((f"{owner}/{field.type.type}" if owner else None, field.name))
    return found
