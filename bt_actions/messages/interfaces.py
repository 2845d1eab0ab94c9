"""The installed actions, services and messages, and their Python classes by name.

Imports no rclpy, and imports a package only after seeing that it holds interfaces.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Literal

from bt_actions.utilities.suggest import did_you_mean, what_it_has

RUN_TREE = "bt_actions_interfaces/action/RunTree"
"""The action of servers of trees."""
DURATION = "builtin_interfaces/msg/Duration"
Kind = Literal["action", "srv", "msg"]
_WORDS = {"action": "action", "srv": "service", "msg": "message"}
PARTS: dict[str, Kind] = {"Goal": "action", "Result": "action", "Feedback": "action",
                          "Request": "srv", "Response": "srv"}  # fmt: skip
"""The parts of an interface, with the kind of interface that has them."""
_NAME = re.compile(r"([a-z][a-z0-9_]*)/(?:(action|srv|msg)/)?([A-Za-z][A-Za-z0-9_]*)")
"""The package of a type, its kind where the name has one, and the short name."""


class UnknownInterface(LookupError, ValueError):
    """An interface that is not installed; the text says which package is missing or what it has."""


class TwoTypes(TypeError):
    """A name of ROS is in use in this process with another type: nothing can be connected to it."""

    def __init__(self, name: str, kind: type, others: Iterable[str]) -> None:
        """Name the type `kind` that was wanted, and the full names of the `others` in use."""
        known = sorted({*others} - {interface_name(kind)})
        also = f", and also as {', '.join(known)}" if known else ", and not with that type alone"
        super().__init__(f"{name} is used as {interface_name(kind)}{also}")


@lru_cache(maxsize=1024)
def interface(name: str | type, kind: Kind) -> type:
    """Return the class of ``"pkg/action/Name"``; ``"pkg/Name"`` will do, as the kind is known.

    A class stands for itself. A class that was found is not looked for again.

    Raises UnknownInterface, which names the package, or what it holds instead.
    """
    if isinstance(name, type):
        return name
    match = _NAME.fullmatch(name)
    if match is None:
        raise UnknownInterface(f"{name!r} is no type name: it is written package/{kind}/Name")
    package, given, short = match.groups()
    if given not in (None, kind):
        raise UnknownInterface(f"{name!r} names no {_WORDS[kind]}, but one of {given}/")
    folders = (Path(entry or ".") / package / kind for entry in sys.path)
    known = next(filter(None, map(_listed, folders)), None)
    if known is None:
        text = f"package {package!r} is not installed here, or has no {_WORDS[kind]}s"
        packages = {each.partition("/")[0] for each in installed(kind)}
        near = did_you_mean(package, packages, cutoff=0.8)  # most end in _msgs
        where = ": install it, or source the workspace it is built in"
        raise UnknownInterface(text + (near or where))
    if short in known:
        found: type = getattr(importlib.import_module(f"{package}.{kind}"), short)
        return found
    near = what_it_has(short, known)
    raise UnknownInterface(f"package {package!r} has no {_WORDS[kind]} {short!r}{near}")


@lru_cache(maxsize=256)
def called(short: str, kind: Kind) -> type:
    """Return the class of ``MoveRobot``, ``pkg/MoveRobot`` or the full name.

    Raises UnknownInterface where none fits, or more than one; it names the candidates.
    """
    if "/" in short:
        return interface(short, kind)
    return interface(full_name(short, installed(kind), _WORDS[kind]), kind)


def full_name(wanted: str, names: Sequence[str], word: str) -> str:
    """Return the one of `names` that `Fetch`, `my_msgs/Fetch` or the full name means.

    Raises UnknownInterface where there is none, or more than one; `word` says of what kind.
    """
    package, _, short = wanted.rpartition("/")
    found = [
        name
        for name in names
        if name == wanted
        or (name.rpartition("/")[2] == short and package in ("", name.partition("/")[0]))
    ]
    if len(found) == 1:
        return found[0]
    if found:
        known = ", ".join(found)
        raise UnknownInterface(f"{wanted!r} is more than one {word}, name it in full: {known}")
    near = did_you_mean(
        wanted, {each for name in names for each in (name, name.rpartition("/")[2])}
    )
    raise UnknownInterface(f"no installed package has the {word} {wanted!r}{near}")


def installed(kind: Kind) -> list[str]:
    """Return the full names of all installed interfaces of a kind."""
    found: dict[str, tuple[str, ...]] = {}  # by package, as the first on the path has them
    for entry in sys.path:
        for file in Path(entry or ".").glob(f"*/{kind}/__init__.py"):
            package = file.parent.parent.name
            found[package] = found.get(package) or _listed(file.parent)
    return sorted(f"{package}/{kind}/{short}" for package in found for short in found[package])


@lru_cache(maxsize=4096)
def interface_name(cls: type) -> str:
    """Return ``"pkg/action/Name"`` of an interface's class."""
    package, kind = cls.__module__.split(".")[:2]
    return f"{package}/{kind}/{cls.__name__}"


def short_name(cls: type) -> str:
    """Return a class's name as people say it: ``MoveRobot.Goal``, ``SetBool.Request``, ``Pose``."""
    owner, _, part = cls.__name__.rpartition("_")
    is_part = owner and part in PARTS and ".msg" not in cls.__module__
    return f"{owner}.{part}" if is_part else cls.__name__


@lru_cache(maxsize=1024)
def _listed(folder: Path) -> tuple[str, ...]:
    """Return the interfaces of a package, read from the file that imports them: nothing is loaded.

    Generated folders import their own hidden modules by full name; others do not.
    """
    try:
        text = (folder / "__init__.py").read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ()
    own = rf"^from {folder.parent.name}\.{folder.name}\._\w+ import ([A-Za-z0-9]+)\b(?!_)"
    return tuple(sorted(set(re.findall(own, text, re.MULTILINE))))
