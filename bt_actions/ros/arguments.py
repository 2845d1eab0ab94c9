"""The parameters that `--ros-args` give a node, asked of rcl before there is that node.

rcl reads the words, and says what they give a node of a name and a namespace. So the asking node
has those of the node to come. This file decides only whom a parameter is meant for.
"""

from __future__ import annotations

import ast
import contextlib
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter

from bt_actions.ros.naming import overrides, passing_node

PARAMETER = ("-p", "--param")
FILE = "--params-file"
_OF_EVERY_NODE = frozenset({"use_sim_time", "start_type_description_service"})
_SETTLED = [Parameter(name, value=False) for name in sorted(_OF_EVERY_NODE)]
"""Overrides for an asking node, which can then be made whatever the words give."""


@dataclass(frozen=True, slots=True)
class Given:
    """The parameters that words give a node, without those that every node has."""

    node: str = ""
    """The node's full name after remapping."""
    values: Mapping[str, object] = field(default_factory=dict)
    """The values; an empty list has no type of its items."""
    written: Mapping[str, str] = field(default_factory=dict)
    """The text of each value that `-p` gives."""
    shared: frozenset[str] = frozenset()
    """The parameters that a file gives to other nodes, too."""
    unused: Sequence[tuple[str, str]] = ()
    """Each `-p` and `--params-file` that gives this node nothing, with its word."""


def given_by(words: Sequence[str], name: str, namespace: str = "") -> Given:
    """Return the parameters that `words` give to a node.

    `name` and `namespace` are the node's, before remapping. Raises ValueError, with a remedy, for
    words that rcl does not understand.
    """
    asks = {"args": ["--ros-args", *words], "parameter_overrides": _SETTLED}
    with _understood(), passing_node(name, namespace=namespace, **asks) as node:
        found = _without_common(overrides(node))
        mine = set[str]()
        written, unused = dict[str, str](), list[tuple[str, str]]()
        for option, word in _sources(words):
            if option == FILE and not Path(word).is_file():
                continue  # a pipe is read once
            its = _given_alone(node, node.get_name(), option, word)
            others = dict[str, Parameter]()
            if option == FILE:
                others = _given_alone(node, f"other_than_{node.get_name()}", option, word)
            else:
                written |= dict.fromkeys(its, word.partition(":=")[2])
            same = {each for each in its.keys() & others if its[each].value == others[each].value}
            mine |= its.keys() - same
            if not its:
                unused.append((option, word))
        return Given(
            node.get_fully_qualified_name(),
            {each: [] if one.value is None else one.value for each, one in found.items()},
            written,
            frozenset(found.keys() - mine),
            unused,
        )


def _sources(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Return the options that give parameters, each with its word."""
    rest = iter(words)
    for option in rest:
        if option in PARAMETER or option == FILE:
            yield option, next(rest)


def _given_alone(beside: Node, name: str, option: str, word: str) -> dict[str, Parameter]:
    """Return the parameters that one option gives to a node of some name, beside another."""
    node = Node(
        name,
        context=beside.context,
        namespace=beside.get_namespace(),
        cli_args=["--ros-args", option, word],
        use_global_arguments=False,
        parameter_overrides=_SETTLED,
        enable_rosout=False,
        start_parameter_services=False,
    )
    try:
        return overrides(node)
    finally:
        node.destroy_node()


def _without_common(found: dict[str, Parameter]) -> dict[str, Parameter]:
    for name in _OF_EVERY_NODE & found.keys():
        if not isinstance(value := found.pop(name).value, bool):
            raise ValueError(f"{name} is true or false, not {value!r}")
    return {name: each for name, each in found.items() if not name.startswith("qos_overrides.")}


@contextlib.contextmanager
def _understood() -> Iterator[None]:
    """Turn rcl's words about a wrong argument into ours, and keep rcl from logging its own."""
    set_logger_level("rcl", LoggingSeverity.FATAL)
    try:
        yield
    except RuntimeError as error:  # rclpy's RCLError
        if type(error).__name__ == "UnknownROSArgsError":  # its text is a list of Python's
            unknown = shlex.join(ast.literal_eval(str(error)))
            remedy = "options of bt-actions stand before --ros-args"
            if ":=" in unknown:
                remedy = "a parameter is written -p NAME:=VALUE, and a rule -r FROM:=TO"
            raise ValueError(f"ROS does not know {unknown}; {remedy}") from error
        raise ValueError(_in_our_words(str(error).splitlines()[0])) from error
    finally:
        set_logger_level("rcl", LoggingSeverity.UNSET)


def _in_our_words(text: str) -> str:
    """Return what is wrong with a word of `--ros-args`, and the right notation."""
    told = re.sub(r", at /.*", "", text).partition(": ")[2] or text
    rule = re.match(r"Couldn't parse (remap|parameter override) rule: '(-\S+ (.*?))'\.", told)
    namespace = "a namespace has letters, digits and _, each part after a slash, as in"
    if rule is None:
        return f"{namespace} __ns:=/r1" if "invalid node namespace" in told else told
    kind, given, word = rule.groups()
    left, assigned, right = word.partition(":=")
    if kind != "remap":
        remedy = "a parameter is written -p NAME:=VALUE, as in -p speed:=0.2"
        if assigned and not right:
            remedy = f"an empty text is written -p \"{left}:=''\""
        elif assigned and "lexeme" not in told and "token" not in told:
            remedy = f"its value is read as YAML, and {told.rpartition('Error: ')[2]}"
    elif left.endswith("__ns"):
        remedy = f"{namespace} {left}:=/r1"
    elif left.endswith(("__node", "__name")):
        remedy = f"a node's name has letters, digits and _ alone, as in {left}:=patrol"
    else:
        remedy = "a rule is written -r FROM:=TO, as in -r move_robot/_action/status:=/r1/status"
    return f"{given!r} is not understood: {remedy}"
