"""Fields of ROS's common messages that never leave a range, as their .msg files say: BT321.

Of a covariance these are the variances; in a sensor's message -1 says that nothing is known.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping

from bt_actions.messages.interfaces import interface_name

_Range = tuple[float, float]
_FRACTION, _UNIT = (0.0, 1.0), (-1.0, 1.0)
_LIMITLESS = float("inf")


def _variances(*names: str, rows: int = 3, least: float = -1.0) -> dict[str, _Range]:
    diagonal = range(0, rows * rows, rows + 1)
    return {f"{name}[{at}]": (least, _LIMITLESS) for name in names for at in diagonal}


_RANGES: Mapping[str, Mapping[str, _Range]] = {
    **dict.fromkeys(
        [f"geometry_msgs/msg/{each}WithCovariance" for each in ("Accel", "Pose", "Twist")],
        _variances("covariance", rows=6, least=0.0),
    ),
    "geometry_msgs/msg/Quaternion": dict.fromkeys("xyzw", _UNIT),
    "sensor_msgs/msg/BatteryState": {"percentage": _FRACTION},
    "sensor_msgs/msg/Imu": _variances(
        "orientation_covariance", "angular_velocity_covariance", "linear_acceleration_covariance"
    ),
    "sensor_msgs/msg/JoyFeedback": {"intensity": _FRACTION},
    "sensor_msgs/msg/MagneticField": _variances("magnetic_field_covariance"),
    "sensor_msgs/msg/NavSatFix": {
        "latitude": (-90.0, 90.0),
        "longitude": (-180.0, 180.0),
        **_variances("position_covariance"),
    },
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
_TURNED: Mapping[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Gt: ast.Lt, ast.GtE: ast.LtE
}  # fmt: skip


def never_held(
    cls: type, name: str, op: ast.cmpop, number: float, *, first: bool = True
) -> str | None:
    """What is wrong with a field that is compared with a number; `first` is the field, or not.

    An item of a list has a name as ``covariance[0]``.
    """
    allowed = _RANGES.get(interface_name(cls), {}).get(name)
    kind = type(op) if first else _TURNED.get(type(op), type(op))
    if allowed is None or kind not in _OUTCOMES:
        return None
    least, most = allowed
    above = number > most or (number == most and kind is ast.Gt)
    if not above and number >= least:
        return None
    outcome = "true" if _OUTCOMES[kind][above] else "false"
    span = f"{least:g} to {most:g}" if most < _LIMITLESS else f"at least {least:g}"
    percent = f"; write {number / 100:g}" if allowed == _FRACTION and 2 <= number <= 100 else ""
    return f"{cls.__name__}.{name} is {span}: this is always {outcome}{percent}"
