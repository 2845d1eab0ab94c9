"""`--ros-args` of a command, as launch appends them; of a run, the parameters that are its inputs.

The node of the command is told of all of them by rclpy, which reads `sys.argv` itself.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bt_actions.cli.exits import BadInput, importing_ros
from bt_actions.utilities.suggest import listing

if TYPE_CHECKING:
    from bt_actions.document import TreeInput


def add_ros_args(parser: argparse.ArgumentParser, help_more: str = "") -> None:
    """Add `--ros-args`, which takes all that follows."""
    parser.add_argument(
        "--ros-args",
        metavar="ARG",
        nargs=argparse.REMAINDER,
        default=[],
        help=f"last of all, words for ROS, as launch gives them{help_more}",
    )


def parameters(words: Sequence[str], namespace: str = "", name: str = "") -> dict[str, object]:
    """Return the parameters that `words` give to the command's node, without rclpy's own.

    `name` is the node's, for files of parameters that name it.
    Raises BadInput for what rcl does not understand.
    """
    if not words:
        return {}
    if "--" in words:
        raise BadInput("--ros-args: all that follows is for ROS; give --ros-args last, without --")
    with importing_ros():
        from bt_actions.ros.parameters import parameters_in

    try:
        return parameters_in(words, namespace, name)
    except ValueError as error:
        raise BadInput(f"--ros-args: {error}") from error


def as_inputs(
    given: Mapping[str, object], declared: Mapping[str, TreeInput], tree: str
) -> dict[str, object]:
    """Return parameters as the inputs that `declared` says `tree` has.

    A text for an input that is a message is read as YAML; ``at.x`` is a field of the input ``at``,
    whose other fields are those of its default. Raises BadInput about the first
    parameter that is no input, or does not fit.
    """
    from bt_actions.document import parse_input
    from bt_actions.document.reading.inputs import convert

    inputs: dict[str, object] = {}
    for name, value in _with_fields(given, declared).items():
        if name not in declared:
            there = f"its inputs are {listing(declared)}" if declared else "it has no inputs"
            text = f"the parameter {name!r} is no input of the tree {tree!r}; {there}"
            raise BadInput(f"--ros-args: {text}")
        kind = declared[name].type
        try:
            is_yaml = isinstance(value, str) and "/" in kind
            inputs[name] = (
                parse_input(str(value), kind) if is_yaml else convert(_read(value, kind), kind)
            )
        except ValueError as error:
            text = f"the parameter {name!r} is {value!r}, and the input is {kind}: {error}"
            raise BadInput(f"--ros-args: {text}") from error
    return inputs


def _with_fields(
    given: Mapping[str, object], declared: Mapping[str, TreeInput]
) -> dict[str, object]:
    """Put the parameters that are fields of inputs back together."""
    values = {name: value for name, value in given.items() if "." not in name}
    for name, value in given.items():
        first, *fields = name.split(".")
        if not fields:
            continue
        if first not in declared or isinstance(values.get(first), str):
            values[name] = value  # which is no input
            continue
        default = declared[first].default
        inner: Any = values.setdefault(first, copy.deepcopy(default) or {})
        for field in fields[:-1]:
            inner = inner.setdefault(field, {}) if isinstance(inner, dict) else {}
        if isinstance(inner, dict):
            inner[fields[-1]] = value
    return values


def _read(value: object, kind: str) -> object:
    """Read the texts within a message that stand for arrays of messages, as `run` shows them."""
    from bt_actions.document.language.types import parse_type
    from bt_actions.document.reading.inputs import parse_text
    from bt_actions.messages.fields import Listing, Message, describe

    def read(inner: object, field: object) -> object:
        if isinstance(inner, dict) and isinstance(field, Message):
            kinds = describe(field.cls)
            return {name: read(item, kinds.get(name)) for name, item in inner.items()}
        if isinstance(inner, str) and isinstance(field, Listing):
            return parse_text(inner)
        return inner

    return read(value, parse_type(kind)) if isinstance(value, dict) else value
