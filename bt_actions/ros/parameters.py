"""A run's inputs as ROS parameters: those that `--ros-args` give before there is a node, and those
that the node then shows.

rcl reads the words: whatever it takes, finds in a file for this node, or refuses is its own to say.
"""

from __future__ import annotations

import ast
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
            participant.close(node, node.context)
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
    shown = list(_shown(name, kind, to_plain(value)))
    if any(node.has_parameter(each.name) for _, each in shown):
        return False
    for its_kind, each in shown:
        node.declare_parameter(each.name, each.type_, ignore_override=True)
        node.set_parameters([each])  # so a list may be empty
        node.set_descriptor(each.name, _descriptor(its_kind, each.type_, description))
    return True


def _shown(name: str, kind: FieldType, value: Any) -> Iterator[tuple[FieldType, Parameter]]:
    """The parameters that an input is, and what they are to a tree."""
    if isinstance(kind, Message):
        for field, its_kind in describe(kind.cls).items():
            yield from _shown(f"{name}.{field}", its_kind, value[field])
        return
    its_type = _type(kind, value)
    if its_type is Parameter.Type.STRING and not isinstance(value, str):
        value = as_json(value)  # which is YAML, and quick for many points
    yield kind, Parameter(name, its_type, value)


def _type(kind: FieldType, value: Any) -> Parameter.Type:
    if isinstance(kind, Listing) and isinstance(kind.item, Scalar):
        single = _type(kind.item, 0)
        if all(_type(kind.item, item) is single for item in value):
            return Parameter.Type[f"{single.name}_ARRAY"]
    if isinstance(kind, Scalar):
        if kind.name in FLOATS:
            return Parameter.Type.DOUBLE
        if kind.name in INTEGERS and value <= _MOST:
            return Parameter.Type.INTEGER
        if kind.name == "bool":
            return Parameter.Type.BOOL
    return Parameter.Type.STRING


def _descriptor(kind: FieldType, its_type: Parameter.Type, description: str) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        type=its_type.value,
        description=description,
        additional_constraints=f"{kind}; fixed while the tree runs",
        read_only=True,
    )
    item = kind.item if isinstance(kind, Listing) else kind
    if isinstance(item, Scalar) and its_type is not Parameter.Type.STRING:
        if item.name in INTEGERS:
            least, most = INTEGERS[item.name]
            descriptor.integer_range = [IntegerRange(from_value=least, to_value=min(most, _MOST))]
        elif item.name == "float32":
            limit = FLOATS[item.name]
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=-limit, to_value=limit)
            ]
    return descriptor


_MOST = INTEGERS["int64"][1]
"""The greatest integer that a parameter holds."""
