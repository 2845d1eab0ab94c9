"""Nodes of a tree as YAML, to be formatted; comments stay before the nodes they stood before."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

_PLAIN = re.compile(r"[A-Za-z$=(/.][\w $./()+*<>=!-]*(?<! )|-?\d+(\.\d+)?( [a-z]+)?", re.ASCII)
_ON_A_LINE = re.compile(r"[A-Za-z$=(/.](?:(?!: | #)[ -~])*(?<![ :])|-?\d+(\.\d+)?( [a-z]+)?")
_READ_OTHERWISE = re.compile(r"(?i:true|false|null|yes|no|on|off|\.inf|\.nan)|=|\.+")
_WIDTH = 60
"""Characters of a mapping or list that stands on one line."""


class Node(dict[str, Any]):
    """A node of a tree of ours, or another mapping of it."""

    def __init__(self, *given: Any, **keys: Any) -> None:
        super().__init__(*given, **keys)
        self.comments: list[str] = []
        """The comments before the node."""
        self.last: list[str] = []
        """The comments behind its children."""
        self.dropped = False
        """Whether the node only keeps the place of one without a meaning here."""


def document(tree: Mapping[str, Any], comments: Iterable[str] = ()) -> str:
    """Return a tree as YAML."""
    lines = [f"# {line}".rstrip() for line in _wrapped(comments)]
    lines += [""] if lines else []
    return "\n".join([*lines, *_mapping(tree)]) + "\n"


def _mapping(mapping: Mapping[str, Any]) -> Iterator[str]:
    for key, value in mapping.items():
        if isinstance(value, Mapping) and value and not isinstance(value, Node):
            flow = _flow(value)
            if len(flow) <= _WIDTH and key not in ("inputs", "actions", "topics", "outputs"):
                yield f"{_scalar(key)}: {flow}"
                continue
        if isinstance(value, Mapping) and value:
            yield f"{_scalar(key)}:"
            yield from _remarks(value, "  ")
            yield from (f"  {line}" for line in _mapping(value))
        elif isinstance(value, list) and value and isinstance(value[0], Node):
            yield f"{_scalar(key)}:"
            for item in value:
                yield from _remarks(item, "  ")
                for at, line in enumerate(_mapping(item)):
                    yield f"  {'- ' if at == 0 else '  '}{line}"
            yield from (f"  # {line}".rstrip() for line in getattr(mapping, "last", ()))
        elif isinstance(value, (list, dict)):
            yield f"{_scalar(key)}: {_flow(value)}"
        else:
            yield f"{_scalar(key)}: {_scalar(value, _ON_A_LINE)}".rstrip()


def _remarks(node: object, indent: str) -> Iterator[str]:
    return (f"{indent}# {line}".rstrip() for line in _wrapped(getattr(node, "comments", ())))


def _wrapped(lines: Iterable[str]) -> Iterator[str]:
    for line in lines:
        yield from textwrap.wrap(line, 90) or [""]


def _flow(value: object) -> str:
    if isinstance(value, Mapping):
        pairs = (f"{_scalar(key)}: {_flow(inner)}" for key, inner in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, value))}]"
    return _scalar(value)


def _scalar(value: object, plain: re.Pattern[str] = _PLAIN) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, str):
        return repr(value)
    number = re.fullmatch(r"[-+.\d].*", value) and not re.fullmatch(r"-?[\d.]+ [a-z]+", value)
    if plain.fullmatch(value) and not _READ_OTHERWISE.fullmatch(value) and not number:
        return value
    if value.isprintable() and "'" not in value:
        return f"'{value}'"
    return json.dumps(value, ensure_ascii=False)
