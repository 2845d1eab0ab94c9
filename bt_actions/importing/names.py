"""Names and values of the XML as names and values of ours."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection

from bt_actions.importing.project import Definition
from bt_actions.importing.scripts import Refused
from bt_actions.importing.text import Node

_LONGEST_NAME = 120
_ROS_NAME = r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*"


NOTHING = {
    "string": "",
    "bool": False,
    "float64": 0.0,
    "float32": 0.0,
    **dict.fromkeys(("int64", "int32", "uint16", "uint8"), 0),
}
"""The value of a variable that nothing wrote, by type; a message has its defaults."""


def identifier(text: str) -> str:
    """Return the name of ours that is nearest to a text."""
    word = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")
    return word if re.match("[A-Za-z]", word) else f"x{word}"


def unique(word: str, taken: Collection[str]) -> str:
    """Return a word, with a number where others have the word."""
    name, number = word, 2
    while name in taken:
        name, number = f"{word}_{number}", number + 1
    return name


def input_name(name: str, *, taken: bool) -> str:
    """Return the name of an input; `taken` where an output has the variable's."""
    return f"{identifier(name)}_in" if taken else identifier(name)


def milliseconds(number: int) -> str:
    """Return milliseconds as a duration."""
    return f"{number // 1000} s" if number % 1000 == 0 and number else f"{number} ms"


def node_name(text: str) -> str:
    """Return a text that can be the name of a node."""
    name = "".join(char if char.isprintable() and char not in ":$#" else " " for char in text)
    return " ".join(name.split())[:_LONGEST_NAME] or "unnamed"


def ros_name(value: object) -> str:
    """Return a name of ROS, or a variable that holds one. Raises Refused."""
    if isinstance(value, str) and re.fullmatch(r"\$[A-Za-z]\w*", value, re.ASCII):
        return f"$({value[1:]})"
    if not isinstance(value, str) or not re.fullmatch(_ROS_NAME, value, re.ASCII):
        raise Refused("port", f"{value!r} is no name of a server or a topic")
    return value


def in_sequence(name: str, nodes: list[Node]) -> Node:
    """Return some nodes as one."""
    return nodes[0] if len(nodes) == 1 else Node(sequence=name, children=nodes)


def value_of(text: str, kind: str) -> object:
    """Return a text of the XML as a value of a type. Raises Refused."""
    if text.startswith("json:"):
        try:
            return json.loads(text.removeprefix("json:"))
        except ValueError:
            raise Refused("port", "it is no JSON") from None
    if "/" in kind:
        raise Refused("text_of_message")
    if kind.endswith("]"):
        return [value_of(each, kind.partition("[")[0]) for each in re.split("[;,]", text) if each]
    if kind == "string":
        return text.replace("$", "$$")
    if kind == "bool" or text in ("true", "false"):
        return text.lower() in ("true", "1")
    if re.fullmatch(r"[-+]?\d+", text):
        return int(text)
    try:
        return float(text)
    except ValueError:
        return text.replace("$", "$$")


class Scope:
    """The names of a tree of the XML, and the words behind a dollar sign for each here."""

    def __init__(
        self,
        definition: Definition,
        prefix: str = "",
        outer: Callable[[str], str | None] | None = None,
    ) -> None:
        self.definition = definition
        self._prefix, self._outer = prefix, outer
        self.literals: dict[str, object] = {}
        """Ports with a constant value, of a tree that is written into its caller."""
        self.topics: dict[str, str] = {}

    def __getitem__(self, name: str) -> str:
        outer = self._outer(name) if self._outer is not None else None
        if outer is not None:
            return outer
        return self.topics.get(name) or f"{self._prefix}{identifier(name)}"
