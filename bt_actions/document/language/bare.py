"""Numbers without a unit that are likely to be meant in another than they are read in."""

from __future__ import annotations

from bt_actions.document.yaml.nodes import Scalar, span_of
from bt_actions.document.yaml.source import Source
from bt_actions.utilities.units import TURN, spoken_duration

__all__ = ["warn_bare_angle", "warn_bare_duration"]

_LONGEST = 40
"""Characters of a number in a message."""
_LONG = 500.0
"""Seconds that somebody would rather give in minutes."""


def warn_bare_duration(node: Scalar, seconds: float, source: Source) -> None:
    """Warn of so many seconds that milliseconds are likely to be meant."""
    if abs(seconds) >= _LONG:
        said = "is {} s = " + spoken_duration(seconds)
        _warn(node, source, "BT317", said, "for milliseconds write {0} ms, else {0} s")


def warn_bare_angle(node: Scalar, radians: float, source: Source) -> None:
    """Warn of an angle beyond a full turn: degrees are likely to be meant."""
    if abs(radians) > TURN:
        _warn(node, source, "BT318", "is in radians", "for degrees write {0} deg, else {0} rad")


def _warn(node: Scalar, source: Source, code: str, said: str, hint: str) -> None:
    text = node.text.strip()
    if text[-1].isalpha():  # a unit
        return
    text = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    message = f"{text} without a unit {said.format(text)}"
    source.report(code, span_of(node), message, hint=hint.format(text))
