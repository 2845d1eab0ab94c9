"""A run's inputs as ROS parameters: those that `--ros-args` give before there is a node, and those
that the node then shows.

rcl reads the words: whatever it takes, finds in a file for this node, or refuses is its own to say.
"""

from __future__ import annotations

import ast
import math
import os
import shlex
from collections.abc import Iterator, Sequence
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
from bt_actions.ros.naming import own_node
from bt_actions.ros.workarounds import participant
from bt_actions.utilities.plain_text import as_json

_OF_EVERY_NODE = frozenset({"use_sim_time", "start_type_description_service"})


def parameters_in(words: Sequence[str], namespace: str = "", name: str = "") -> dict[str, object]:
    """The values that the words behind `--ros-args` give to a node, without rclpy's own parameters.

    Raises ValueError, with rcl's reason, for words that it does not understand.
    """
    try:
        node = own_node(
            name or f"bt_actions_{os.getpid()}_parameters",
            args=["--ros-args", *words],
            namespace=namespace,
            automatically_declare_parameters_from_overrides=True,
        )
        try:
            found = node.get_parameters_by_prefix("")
        finally:
            participant.close(node)
    except RuntimeError as error:  # rclpy's RCLError
        if type(error).__name__ == "UnknownROSArgsError":  # whose text is a list of Python's
            unknown = shlex.join(ast.literal_eval(str(error)))
            why = f"ROS does not know {unknown}; options of bt-actions stand before --ros-args"
            raise ValueError(why) from error
        raise ValueError(str(error).splitlines()[0]) from error
    for name in _OF_EVERY_NODE & found.keys():
        if not isinstance(found[name].value, bool):
            raise ValueError(f"{name} is true or false, not {found[name].value!r}")
    return {
        name: parameter.value
        for name, parameter in found.items()
        if name not in _OF_EVERY_NODE and not name.startswith("qos_overrides.")
    }


def declare_input(node: Node, name: str, kind: FieldType, value: object, description: str) -> bool:
    """Show the value of an input as a read-only parameter of the node; of a message, one a field.

    Arrays of messages, and integers beyond int64, are texts, in YAML. False where the node has a
    parameter of that name already: then nothing is shown.
    """
    shown = list(_shown(name, kind, to_plain(value), description))
    if any(node.has_parameter(each.name) for each, _ in shown):
        return False
    for each, descriptor in shown:
        node.declare_parameter(each.name, each.type_, ignore_override=True)
        node.set_parameters([each])  # so a list may be empty
        node.set_descriptor(each.name, descriptor)
    return True


def _shown(
    name: str, kind: FieldType, value: Any, description: str
) -> Iterator[tuple[Parameter, ParameterDescriptor]]:
    """The parameters that an input is."""
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
        value = as_json(value)  # which is YAML, and quick for many points
    descriptor = ParameterDescriptor(
        type=its_type.value,
        description=description,
        additional_constraints=f"{kind}; fixed while the tree runs",
        read_only=True,
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
"""What the types of fields are as parameters; any other is a text."""
