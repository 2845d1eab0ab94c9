"""Numbers without a unit that are likely to be meant in another than they are read in."""

from __future__ import annotations

from bt_actions.document.yaml.nodes import Scalar, span_of
from bt_actions.document.yaml.source import Source
from bt_actions.utilities.units import TURN, spoken_duration

_LONGEST = 40
"""Characters of a number in a message."""
_LONG = 500.0
"""Seconds that somebody would rather give in minutes."""


def warn_bare_duration(node: Scalar, seconds: float, source: Source) -> None:
    """Warn of so many seconds that milliseconds are likely to be meant."""
    text = node.text.strip()
    if abs(seconds) >= _LONG and not text[-1].isalpha():
        text = _brief(text)
        source.report(
            "BT317", span_of(node),
            f"{text} without a unit is {text} s = {spoken_duration(seconds)}",
            hint=f"for milliseconds write {text} ms, else {text} s",
        )  # fmt: skip


def warn_bare_angle(node: Scalar, radians: float, source: Source) -> None:
    """Warn of an angle beyond a full turn: degrees are likely to be meant."""
    text = node.text.strip()
    if abs(radians) > TURN and not text[-1].isalpha():
        text = _brief(text)
        source.report(
            "BT318", span_of(node), f"{text} without a unit is in radians",
            hint=f"for degrees write {text} deg, else {text} rad",
        )  # fmt: skip


def _brief(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
