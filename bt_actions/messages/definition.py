"""The text of an interface, with that of the messages in it, as `ros2 interface show` prints it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from bt_actions.messages.interfaces import UnknownInterface, installed

_FIELD = re.compile(r"\s*([A-Za-z]\w*(?:/[A-Z]\w*)?)(?:<=\d+)?(?:\[[^\]]*\])?\s+\w+")


def all_interfaces() -> list[str]:
    """Return the full names of all installed actions, services and messages."""
    return sorted(name for kind in ("action", "srv", "msg") for name in installed(kind))


def definition(name: str, *, all_comments: bool = False) -> Iterator[str]:
    """Yield the lines of an interface, each message in it below its field, indented.

    `name` is given in full. Comments of messages in it are left out, unless `all_comments`. Raises
    UnknownInterface where the file is not installed.
    """
    package, kind, short = name.split("/")
    return _lines(package, kind, short, "", comments=True, below=all_comments)


def _lines(
    package: str, kind: str, short: str, indent: str, *, comments: bool, below: bool
) -> Iterator[str]:
    text = _text(package, kind, short)
    for line in text.splitlines():
        shown = line.rstrip() if comments else re.sub(r"\s*#.*", "", line).rstrip()
        if shown or comments:
            yield f"{indent}{shown}".rstrip()
        field = _FIELD.match(line)
        if field is None or not re.search(r"(^|/)[A-Z]", field[1]):
            continue
        owner, _, message = field[1].rpartition("/")
        yield from _lines(
            owner or package, "msg", message, f"{indent}\t", comments=below, below=below
        )


def _text(package: str, kind: str, short: str) -> str:
    for entry in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        for suffix in (kind, "idl"):
            path = Path(entry or ".") / "share" / package / kind / f"{short}.{suffix}"
            if path.is_file():
                return path.read_text(encoding="utf-8", errors="replace")
    raise UnknownInterface(
        f"{package}/{kind}/{short} is installed without its file share/{package}/{kind}/"
        f"{short}.{kind}"
    )
