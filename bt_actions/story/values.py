"""Values of events in words: of a message its fields, of a long value the beginning."""

from __future__ import annotations

from collections.abc import Mapping

from bt_actions.events.snapshot import Cut, Value
from bt_actions.story.actions import ActionStory
from bt_actions.utilities.shorten import fit, shorten

Constants = Mapping[str, Value]
"""By field the names of numbers."""
LONG = 200
"""Characters of a value; longer ones are cut."""


def brief(value: object) -> str:
    """Return a value as people read it, short however large it is; a text without quotes."""
    return fit(value, LONG) if isinstance(value, str) else shorten(value, LONG)


def feedback_text(action: ActionStory) -> str:
    """Return the latest feedback of an action on one line: its plain fields."""
    came = action.latest.feedback if action.latest is not None else None
    return "" if came is None else fields_text(came.feedback, constants_of(action, "feedback"))


def constants_of(action: ActionStory, message: str) -> Constants:
    """Return the constants of `goal`, `result` or `feedback`: their names by field and number."""
    constants = action.node.settings.get("constants")
    found = constants.get(message) if isinstance(constants, dict) else None
    return found if isinstance(found, dict) else {}


def fields_text(message: Value, constants: Constants, most: int = 4) -> str:
    """Return the first scalar fields of a message: names, values, constants by their name."""
    parts: list[str] = []
    for field, value in opened(message).items():
        if isinstance(value, Cut) and isinstance(value.head, str):
            value = f"{value.head}…"
        if isinstance(value, float):
            parts.append(f"{field} {value:.2f}")
        elif isinstance(value, str):
            parts.append(f"{field} {fit(value, 80)}")
        elif isinstance(value, bool):
            parts.append(f"{field} {str(value).lower()}")
        elif isinstance(value, int):
            parts.append(f"{field} {named(constants, field, value)}")
    return ", ".join(parts[:most])


def opened(message: Value) -> dict[str, Value]:
    """Return the fields of a message that are known."""
    if isinstance(message, Cut):
        message = message.head
    return message if isinstance(message, dict) else {}


def named(constants: Constants, field: str, value: int) -> str:
    """The constant FIELD_X of the message's type that has `value`, as X; else the number."""
    named = constants.get(field)
    name = named.get(str(value)) if isinstance(named, dict) else None
    return name if isinstance(name, str) else str(value)
