"""The ROS parameters that a node of ours shows: the inputs of a run, the options of a server."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from bt_actions.messages.conversion import to_plain
from bt_actions.messages.fields import (
    FLOATS,
    INTEGERS,
    FieldType,
    Listing,
    Message,
    Scalar,
    describe,
)
from bt_actions.utilities.plain_text import as_json


def declare_input(node: Node, name: str, kind: FieldType, value: object, description: str) -> bool:
    """Declare the value of an input as a read-only parameter; of a message, one for each field.

    Arrays of messages, and integers beyond int64, are texts, in YAML. Return False where the node
    has a parameter of that name already: then nothing is declared.
    """
    shown = list(_shown(name, kind, to_plain(value), description))
    if any(node.has_parameter(each.name) for each, _ in shown):
        return False
    for each, descriptor in shown:
        declare(node, each, descriptor)
    return True


def typed(name: str, value: object) -> Parameter:
    """Return a parameter; a list is one of texts, an empty one too."""
    kind = Parameter.Type.STRING_ARRAY if isinstance(value, list) else None
    return Parameter(name, kind, value)


def declare(node: Node, parameter: Parameter, descriptor: ParameterDescriptor) -> None:
    """Declare a read-only parameter with its type, which an empty list would not tell."""
    descriptor.type, descriptor.read_only = parameter.type_.value, True
    node.declare_parameter(parameter.name, parameter.type_, ignore_override=True)
    node.set_parameters([parameter])
    node.set_descriptor(parameter.name, descriptor)


def _shown(
    name: str, kind: FieldType, value: Any, description: str
) -> Iterator[tuple[Parameter, ParameterDescriptor]]:
    """Yield the parameters of an input."""
    if isinstance(kind, Message):
        for field, its_kind in describe(kind.cls).items():
            yield from _shown(f"{name}.{field}", its_kind, value[field], description)
        return
    item, values, ending = kind, [value], ""
    if isinstance(kind, Listing):
        item, values, ending = kind.item, value, "_ARRAY"
    scalar = item.name if isinstance(item, Scalar) else ""
    limits = INTEGERS.get(scalar)
    its_type = Parameter.Type[_SINGLE.get(scalar, "STRING") + ending]
    if not scalar or (limits and max(values, default=0) > _MOST):
        limits, its_type = None, Parameter.Type.STRING
        value = as_json(value)  # JSON is YAML, and quick for many points
    descriptor = ParameterDescriptor(
        description=description,
        additional_constraints=f"{kind}; fixed while the tree runs",
    )
    if limits:
        least, most = limits[0], min(limits[1], _MOST)
        descriptor.integer_range = [IntegerRange(from_value=least, to_value=most)]
    elif scalar == "float32" and all(map(math.isfinite, values)):
        limit = FLOATS[scalar]
        descriptor.floating_point_range = [FloatingPointRange(from_value=-limit, to_value=limit)]
    yield Parameter(name, its_type, value), descriptor


_MOST = INTEGERS["int64"][1]
"""The greatest integer that a parameter holds."""
_SINGLE = {**dict.fromkeys(INTEGERS, "INTEGER"), **dict.fromkeys(FLOATS, "DOUBLE"), "bool": "BOOL"}
"""The parameter types of fields' types; a text for any other."""
