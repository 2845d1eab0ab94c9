"""`--ros-args` of a command, as launch appends them; those of a run hold parameters for inputs.

rclpy reads `sys.argv` itself, and gives the node all of them. A parameter that nothing uses is
reported: an error where it is meant for this node alone, else a warning.
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bt_actions.cli.arguments.values import nested
from bt_actions.cli.exits import BadInput, importing_ros
from bt_actions.cli.streams.writing import note
from bt_actions.utilities.suggest import did_you_mean, listing

if TYPE_CHECKING:
    from bt_actions.document import TreeInput
    from bt_actions.messages.fields import FieldType
    from bt_actions.ros.arguments import Given


def add_ros_args(parser: argparse.ArgumentParser, help_more: str = "") -> None:
    """Add `--ros-args`, which takes all words behind it."""
    parser.add_argument(
        "--ros-args",
        metavar="ARG",
        nargs=argparse.REMAINDER,
        default=[],
        help=f"last of all, words for ROS, as launch gives them{help_more}",
    )


def parameters(words: Sequence[str], name: str, namespace: str = "") -> Given | None:
    """Return the parameters that `words` give to the command's node, without rclpy's own.

    `name` and `namespace` are the node's, before remapping. Words that give the node nothing are
    reported. Raises BadInput for words that rcl does not understand.
    """
    if not words:
        return None
    if "--" in words:
        raise BadInput("--ros-args: all that follows is for ROS; give --ros-args last, without --")
    with importing_ros():
        from bt_actions.ros.arguments import FILE, given_by

    try:
        given = given_by(words, name, namespace)
    except ValueError as error:
        raise BadInput(f"--ros-args: {error}") from error
    for option, word in given.unused:
        instead = f"without the name it does: {option} {word.partition(':')[2]}"
        if option == FILE:
            instead = f"it is for {listing(_nodes_in(Path(word))) or 'nobody'}"
        note(f"bt-actions: {option} {word} has nothing for this node, {given.node}; {instead}")
    return given


def no_parameters(words: Sequence[str], command: str, name: str, namespace: str = "") -> None:
    """Check the words of a command whose node has no parameters but those of every node."""
    taken(parameters(words, name, namespace), (), f"parameter of bt-actions {command}")


def taken(
    given: Given | None,
    known: Collection[str],
    what: str,
    *,
    with_fields: Collection[str] = (),
    other_users: bool = False,
) -> dict[str, object]:
    """Return the parameters that are `known`, or fields of one `with_fields`.

    Raises BadInput for another one that is meant for this node, unless the node has `other_users`
    of parameters and the name is like no known one. Reports all others: a file gives some to
    other nodes, too. `what` is the noun for a known one.
    """
    if given is None:
        return {}
    others = dict[str, str]()
    for name in given.values:
        first, _, field = name.partition(".")
        if name not in known and not (field and first in with_fields):
            others[name] = did_you_mean(first, known)
    for name, near in others.items():
        if name not in given.shared and (near or not other_users):
            there = near or (f"; there is {listing(known)}" if known else "")
            raise BadInput(f"--ros-args: the parameter {name!r} is no {what}{there}")
    if others:
        told = listing(f"{name}{near and f' ({near[2:]})'}" for name, near in others.items())
        note(f"bt-actions: --ros-args: no {what}, and not used: {told}")
    return {name: value for name, value in given.values.items() if name not in others}


def as_inputs(given: Given | None, declared: Mapping[str, TreeInput], tree: str) -> dict[str, Any]:
    """Return parameters as the inputs that `declared` says `tree` has.

    A text for an input that is a message is read as YAML; ``at.x`` is a field of the input ``at``,
    whose other fields are those of its default. Raises BadInput about the first parameter that is
    no input, or does not fit.
    """
    from bt_actions.document.language.types import parse_type
    from bt_actions.messages.conversion import MessageError, fill_value
    from bt_actions.messages.fields import Message

    inputs: dict[str, object] = {}
    kinds = {name: parse_type(each.type) for name, each in declared.items()}
    messages = [name for name, kind in kinds.items() if isinstance(kind, Message)]
    values = taken(given, declared, f"input of the tree {tree!r}", with_fields=messages)
    for name in dict.fromkeys(each.partition(".")[0] for each in values):
        path, kind = name, kinds[name]
        fields = {each: one for each, one in values.items() if each.startswith(f"{name}.")}
        try:
            value = _read(values[name], kind) if name in values else declared[name].default
            if fields:
                value = _over(value, _read(nested(fields)[name], kind), kind)
            inputs[name] = value if kind is None else fill_value(kind, value)
        except ValueError as error:
            why = str(error)
            if isinstance(error, MessageError):
                why = error.problems[0].text
                path = ".".join([name, *map(str, error.problems[0].path)])
            raise BadInput(_no_fit(given, path, declared[name].type, values, why)) from error
    return inputs


def _no_fit(
    given: Given | None, name: str, kind: str, values: Mapping[str, object], why: str
) -> str:
    """Say that a parameter does not fit the input of its name, or the field of one."""
    from bt_actions.messages.conversion import show

    assert given is not None
    whole = name.partition(".")[0]
    name = next((each for each in values if each.startswith(f"{name}.")), name)
    below = ""
    while name not in values and "." in name:  # the item of a list, a field of a text
        name, _, below = name.rpartition(".")
        why = f"{below}: {why}"
    value = f" is {show(values[name])}, and" if name in values else ":"
    of = "" if name == whole else f" {whole!r}"
    text = f"--ros-args: the parameter {name!r}{value} the input{of} is {kind}: {why}"
    if "a text is needed" not in why:
        return text
    if name not in given.written:
        return f"{text}; put it in quotes in the file"
    written = "'{}'".format(given.written[name].replace("'", "''"))
    if below and isinstance(items := values[name], list):
        written = str([str(each).lower() for each in items])
    word = f"{name}:={written}".replace('"', r"\"")
    return f'{text}; quotes make it one: -p "{word}"'


def _over(value: Any, fields: Any, kind: FieldType | None) -> Any:
    """Return a value with some fields replaced, in whatever form the value is."""
    from bt_actions.messages.conveniences import ANGLES
    from bt_actions.messages.conversion import fill_value, to_plain
    from bt_actions.messages.fields import Message, describe

    if not isinstance(fields, dict) or not isinstance(kind, Message):
        return fields
    angles = isinstance(value, Mapping) and not value.keys().isdisjoint(ANGLES)
    if value is None:
        value = {}
    elif not isinstance(value, Mapping) or (angles and fields.keys().isdisjoint(ANGLES)):
        value = to_plain(fill_value(kind, value))
    kinds = describe(kind.cls)
    return {
        **value,
        **{name: _over(value.get(name), each, kinds.get(name)) for name, each in fields.items()},
    }


def _read(value: Any, kind: FieldType | None) -> Any:
    """Read the texts for types that no parameter has: a message, a list of messages, a uint64."""
    from bt_actions.document.language.values import names_file, read_data
    from bt_actions.document.reading.inputs import parse_text
    from bt_actions.messages.fields import Listing, Message, Scalar, describe

    if isinstance(value, dict) and isinstance(kind, Message):
        kinds = describe(kind.cls)
        return {name: _read(each, kinds.get(name)) for name, each in value.items()}
    is_yaml = isinstance(kind, Message | Listing) or kind == Scalar("uint64")
    if not isinstance(value, str) or not is_yaml:
        return value
    data = read_data(Path(value[1:]), pipes=True) if names_file(value) else parse_text(value)
    return {} if data is None else data


def _nodes_in(path: Path) -> Iterator[str]:
    """Yield the nodes, and patterns of nodes, with a section in a file of parameters."""
    from bt_actions.document.language.values import read_data

    with contextlib.suppress(ValueError, OSError):
        waiting: list[tuple[str, object]] = [("", read_data(path))]
        while waiting:
            name, section = waiting.pop(0)
            if isinstance(section, Mapping):
                if "ros__parameters" in section:
                    yield name
                waiting += [
                    (f"{name}/{str(each).strip('/')}", inner)
                    for each, inner in section.items()
                    if each != "ros__parameters"
                ]
