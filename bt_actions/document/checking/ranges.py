"""Fields of ROS's common messages that never leave a range, as their .msg files say: BT321.

A covariance is not among them: -1 as the first of its items says that nothing is known.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping

from bt_actions.messages.interfaces import interface_name

__all__ = ["never_held"]

_Range = tuple[float, float]
_FRACTION, _UNIT = (0.0, 1.0), (-1.0, 1.0)
_RANGES: Mapping[str, Mapping[str, _Range]] = {
    "geometry_msgs/msg/Quaternion": dict.fromkeys("xyzw", _UNIT),
    "sensor_msgs/msg/BatteryState": {"percentage": _FRACTION},
    "sensor_msgs/msg/JoyFeedback": {"intensity": _FRACTION},
    "sensor_msgs/msg/NavSatFix": {"latitude": (-90.0, 90.0), "longitude": (-180.0, 180.0)},
    "sensor_msgs/msg/RelativeHumidity": {"relative_humidity": _FRACTION},
    "visualization_msgs/msg/UVCoordinate": dict.fromkeys("uv", _FRACTION),
}
_OUTCOMES: Mapping[type[ast.cmpop], tuple[bool, bool]] = {
    ast.Lt: (False, True),
    ast.LtE: (False, True),
    ast.Gt: (True, False),
    ast.GtE: (True, False),
    ast.Eq: (False, False),
    ast.NotEq: (True, True),
}
"""What a field's comparison with a number gives: with one below its range, with one above."""


def never_held(
    cls: type, name: str, op: ast.cmpop, number: float, *, first: bool = True
) -> str | None:
    """What is wrong with a field that is compared with a number; `first` is the field, or not."""
    allowed = _RANGES.get(interface_name(cls), {}).get(name)
    if allowed is None or type(op) not in _OUTCOMES or allowed[0] <= number <= allowed[1]:
        return None
    ordered = not isinstance(op, ast.Eq | ast.NotEq)
    outcome = _OUTCOMES[type(op)][number > allowed[1]] ^ (ordered and not first)
    said = f"{cls.__name__}.{name} is {allowed[0]:g} to {allowed[1]:g}: this is always"
    percent = f"; write {number / 100:g}" if allowed == _FRACTION and 1.0 < number <= 100.0 else ""
    return f"{said} {'true' if outcome else 'false'}{percent}"
