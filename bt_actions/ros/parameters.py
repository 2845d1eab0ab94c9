"""The ROS parameters that `--ros-args` give to a node, before there is one.

rcl reads the words: whatever it takes, finds in a file for this node, or refuses is its own to say.
"""

from __future__ import annotations

import ast
import os
import shlex
from collections.abc import Sequence

from rclpy.context import Context
from rclpy.node import Node

from bt_actions.ros import participant

__all__ = ["parameters_in"]

_OF_EVERY_NODE = frozenset({"use_sim_time", "start_type_description_service"})


def parameters_in(words: Sequence[str], namespace: str = "", name: str = "") -> dict[str, object]:
    """The values that the words behind `--ros-args` give to a node, without rclpy's own parameters.

    Raises ValueError, with rcl's reason, for words that it does not understand.
    """
    context = Context()
    try:
        context.init(args=["--ros-args", *words])
        node = Node(
            name or f"bt_actions_{os.getpid()}_parameters",
            context=context,
            namespace=namespace,
            enable_rosout=False,
            start_parameter_services=False,
            automatically_declare_parameters_from_overrides=True,
        )
        try:
            found = node.get_parameters_by_prefix("")
        finally:
            participant.close(node, context)
    except RuntimeError as error:  # rclpy's RCLError
        if type(error).__name__ == "UnknownROSArgsError":  # whose text is a list of Python's
            unknown = shlex.join(ast.literal_eval(str(error)))
            why = f"ROS does not know {unknown}; options of bt-actions stand before --ros-args"
            raise ValueError(why) from error
        raise ValueError(str(error).splitlines()[0]) from error
    finally:
        context.try_shutdown()
    for name in _OF_EVERY_NODE & found.keys():
        if not isinstance(found[name].value, bool):
            raise ValueError(f"{name} is true or false, not {found[name].value!r}")
    return {
        name: parameter.value
        for name, parameter in found.items()
        if name not in _OF_EVERY_NODE and not name.startswith("qos_overrides.")
    }
