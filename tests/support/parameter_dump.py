"""The parameters of a node as `ros2 param dump` writes them: ros2cli is not on the index."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import yaml
from rclpy.parameter import parameter_value_to_python


def dumped(node: str, names: Iterable[str], values: Iterable[Any]) -> str:
    """Return the file of parameters for a node's full name, which has ParameterValues."""
    tree: dict[str, Any] = {}
    for name, value in zip(names, values, strict=True):
        *above, last = name.split(".")
        at = tree
        for step in above:
            at = at.setdefault(step, {})
        plain = parameter_value_to_python(value)
        at[last] = plain.tolist() if hasattr(plain, "tolist") else plain
    return str(yaml.safe_dump({node: {"ros__parameters": tree}}))
