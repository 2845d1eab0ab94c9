"""Values of events in words: the fields of a message, the beginning of a long value."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial

from bt_actions.events.kinds import RoundBegan
from bt_actions.events.snapshot import Cut, Value
from bt_actions.story.actions import ActionStory, GoalStory
from bt_actions.utilities.shorten import fit, scalars, shorten

LONG = 80
"""Characters of one value."""

Constants = Mapping[str, Value]
"""The names of numbers, by field."""


def feedback_text(action: ActionStory) -> str:
    """Return the latest feedback of an action on one line: its plain fields."""
    came = action.latest.feedback if action.latest is not None else None
    return "" if came is None else fields_text(came.feedback, constants_of(action, "feedback"))


def round_text(begun: RoundBegan, of: str = "") -> str:
    """Return ``item 2 of 3 (4.5)``, or ``round 2``; `of` names the loop."""
    word = "round" if begun.item is None else "item"
    most = "" if begun.of is None else f" of {begun.of}"
    item = "" if begun.item is None else f" ({shorten(begun.item, LONG)})"
    return f"{word} {begun.number + 1}{most}{of}{item}"


def unmet_text(goal: GoalStory) -> str:
    """Say which values an unmet `expect` saw in its attempt's result; "" where none did."""
    verdict = goal.verdict
    if verdict is None or not verdict.expect:
        return ""
    seen = ", ".join(f"{name} is {shorten(value, LONG)}" for name, value in verdict.seen.items())
    wanted = f"expected {fit(verdict.expect, 100)}"
    return f"{seen}; {wanted}" if seen else wanted


def constants_of(action: ActionStory, message: str) -> Constants:
    """Return the constants of `goal`, `result` or `feedback`: their names by field and number."""
    constants = action.node.settings.get("constants")
    found = constants.get(message) if isinstance(constants, dict) else None
    return found if isinstance(found, dict) else {}


def fields_text(message: Value, constants: Constants) -> str:
    """Return the first scalar fields of a message: names, values, constants by their name."""
    fields = (
        (
            field,
            f"{value.head}…" if isinstance(value, Cut) and isinstance(value.head, str) else value,
        )
        for field, value in opened(message).items()
    )
    return scalars(fields, partial(named, constants))


def opened(message: Value) -> dict[str, Value]:
    """Return the fields of a message that are known."""
    if isinstance(message, Cut):
        message = message.head
    return message if isinstance(message, dict) else {}


def named(constants: Constants, field: str, value: int) -> str:
    """Return the constant FIELD_X of the message's type that has `value`, as X; else the number."""
    named = constants.get(field)
    name = named.get(str(value)) if isinstance(named, dict) else None
    return name if isinstance(name, str) else str(value)


def clock(wall: float) -> str:
    """Return a moment of the computer's clock as its users read it."""
    return time.strftime("%H:%M:%S", time.localtime(wall))
