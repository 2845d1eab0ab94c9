"""Values given to a tree, checked against the inputs that the tree declares."""

from __future__ import annotations

import array
import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bt_actions.document.language.types import parse_type
from bt_actions.document.language.values import (
    names_file,
    read_data,
    read_value,
    refuse_large,
    resolve,
)
from bt_actions.document.reading.tree import Document
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.source import Source, TooManyErrors
from bt_actions.messages.fields import Message, Scalar
from bt_actions.utilities.suggest import did_you_mean, listing


class InputError(ValueError):
    """A value that does not fit the inputs of a tree; the fault is the giver's."""

    def __init__(self, message: str, missing: str = "") -> None:
        """Take the text; `missing` is the input without a value, where that is the error."""
        super().__init__(message)
        self.missing = missing


@dataclass(frozen=True, slots=True)
class TreeInput:
    """An input as a tree declares it."""

    name: str
    type: str
    required: bool
    default: object = None
    unit: str = ""
    description: str = ""
    secret: bool = False
    """Whether events, logs and files keep the value to themselves."""


def inputs_of(document: Document) -> dict[str, TreeInput]:
    """Return the inputs that a tree declares."""
    return {
        name: TreeInput(
            name,
            str(declared.values.get("type", "")),
            "default" not in declared.values,
            declared.values.get("default"),
            str(declared.values.get("unit", "")),
            str(declared.values.get("description", "")),
            declared.values.get("secret") is True,
        )
        for name, declared in document.inputs.items()
    }


def check_inputs(
    document: Document, given: Mapping[str, object], *, types: bool = True
) -> dict[str, object]:
    """Return the value of every input: the given value, converted to its type, or the default.

    Raises InputError for an unknown input, a missing one, or a value that does not fit.
    """
    for name in given:
        if name not in document.inputs:
            known = listing(document.inputs)
            there = f"; its inputs are {known}" if known else ": it has no inputs"
            near = did_you_mean(str(name), document.inputs) or there
            raise InputError(f"the tree {document.name!r} has no input {name!r}{near}")
    values: dict[str, object] = {}
    for name, declared in document.inputs.items():
        text = str(declared.values.get("type"))
        if name in given:
            values[name] = _fit(document, name, given[name], text, types=types)
        elif "default" in declared.values:
            values[name] = _fit(document, name, declared.values["default"], text, types=types)
        else:
            needs = f"the tree {document.name!r} needs the input {name!r} ({text})"
            raise InputError(f"{needs}: give it a value", missing=name)
    return values


def convert(value: object, type_name: str, *, types: bool = True) -> object:
    """Convert a value to the type of an input. Raises ValueError with a readable text."""
    kind = parse_type(type_name, types=types)
    if kind is None:
        return value
    from bt_actions.messages.conversion import fill_value

    return fill_value(kind, value)


def parse_input(text: str, type_name: str) -> object:
    """Read a value from the command line, for an input of a type.

    A `string` is taken as it stands; ``@points.yaml`` stands for the content of that file; anything
    else is YAML (``[1, 2]``, ``{x: 1.0}``). Raises ValueError with a readable text.
    """
    kind = parse_type(type_name)
    if isinstance(kind, Scalar) and kind.name == "string":
        return convert(text, type_name)
    if names_file(text):
        return convert(read_data(Path(text[1:]), pipes=True), type_name)
    value = parse_text(text)
    if value is None and isinstance(kind, Message):
        value = {}
    return convert(value, type_name)


def parse_text(text: str) -> object:
    """Read a text of YAML as plain data. Raises ValueError with a readable text."""
    source = Source("value", text)
    node = compose(source)
    if source.findings:
        raise ValueError(f"{text!r}: {source.findings[0].message}")
    value: object = None
    with contextlib.suppress(TooManyErrors):  # the source has them
        value = None if node is None else read_value(node, source)
    for finding in source.findings:
        raise ValueError(f"{finding.message} ({finding.hint})" if finding.hint else finding.message)
    value = resolve(value, lambda name: f"${name}")
    refuse_large(value)
    refuse_infinite(value)
    return value


def refuse_infinite(value: object) -> None:
    """Raise ValueError for a value that is, or holds, a number that is not finite."""
    waiting = [value]
    while waiting:
        value = waiting.pop()
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"a finite number is needed, not {value}")
        if isinstance(value, Mapping):
            waiting.extend(value.values())
        elif isinstance(value, list | tuple):
            waiting.extend(value)
        elif isinstance(value, array.array) and all(map(math.isfinite, value)):
            continue  # seen without a loop of Python's
        elif hasattr(value, "tolist"):
            waiting.append(value.tolist())


def _fit(document: Document, name: str, value: object, text: str, *, types: bool) -> object:
    try:
        refuse_infinite(value)
        return convert(value, text, types=types)
    except ValueError as error:
        is_secret = document.inputs[name].values.get("secret") is True
        said = f"it is secret, and no {text}" if is_secret else error
        raise InputError(f"input {name!r} of {document.name!r}: {said}") from None
