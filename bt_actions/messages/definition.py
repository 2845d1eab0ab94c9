"""The text of an interface, with that of the messages in it, as `ros2 interface show` prints it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from bt_actions.messages.interfaces import UnknownInterface, installed

_FIELD = re.compile(r"\s*((?:[A-Za-z]\w*/)?[A-Z]\w*)(?:<=\d+)?(?:\[[^\]]*\])?\s+\w+")
"""A field that is a message: the types of all others begin with a small letter."""


def all_interfaces() -> list[str]:
    """Return the full names of all installed actions, services and messages."""
    return sorted(name for kind in ("action", "srv", "msg") for name in installed(kind))


def definition(
    name: str, *, comments: bool = True, all_comments: bool = False, indent: str = ""
) -> Iterator[str]:
    """Yield the lines of an interface, each message in it below its field, indented.

    `name` is given in full. Comments of messages in it are left out, unless `all_comments`. Raises
    UnknownInterface where the file is not installed.
    """
    package = name.partition("/")[0]
    for line in _text(name).splitlines():
        shown = line.rstrip() if comments else re.sub(r"\s*#.*", "", line).rstrip()
        if shown or comments:
            yield f"{indent}{shown}".rstrip()
        if field := _FIELD.match(line):
            owner, _, message = field[1].rpartition("/")
            yield from definition(
                f"{owner or package}/msg/{message}",
                comments=all_comments,
                all_comments=all_comments,
                indent=f"{indent}\t",
            )


def _text(name: str) -> str:
    package, kind, short = name.split("/")
    file = f"share/{package}/{kind}/{short}"
    for entry in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        for suffix in (kind, "idl"):
            path = Path(entry or ".") / f"{file}.{suffix}"
            if path.is_file():
                return path.read_text(encoding="utf-8", errors="replace")
    raise UnknownInterface(f"{name} is installed without its file {file}.{kind}")


def ros2msg(name: str) -> str:
    """Return a message's text, and below lines of ``=`` those of the messages in it.

    This is the form in which MCAP has schemas of ROS 2. Raises UnknownInterface.
    """
    texts, waiting = dict[str, str](), [name]
    while waiting:
        if (each := waiting.pop()) in texts:
            continue
        texts[each] = f"{_text(each).rstrip()}\n"
        for line in texts[each].splitlines():
            if field := _FIELD.match(line):
                owner, _, message = field[1].rpartition("/")
                waiting.append(f"{owner or each.partition('/')[0]}/msg/{message}")
    first = texts.pop(name)
    return first + "".join(
        f"{'=' * 80}\nMSG: {each.replace('/msg/', '/')}\n{text}" for each, text in texts.items()
    )
