"""The inputs of a RunTree goal: a text from a stranger, read within bounds. No ROS.

Nothing in the text is computed, and no file is read: a dollar sign and an @ mean themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from bt_actions.document import DocumentError, source_of
from bt_actions.document.language.values import refuse_large
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.nodes import Mapping as YamlMapping
from bt_actions.document.yaml.nodes import data_of
from bt_actions.utilities.plain_text import clean

MAX_BYTES = 256 * 1024
"""Bytes of a goal's `inputs`, in UTF-8."""
_LONGEST = 1000
"""Characters of a reason, which may quote the text."""


class GoalRefused(Exception):
    """A refusal of a goal. `code` is a rule's (BT104), or a word in capitals."""

    def __init__(self, code: str, message: str, place: str = "") -> None:
        said = clean(message)
        said = said if len(said) <= _LONGEST else f"{said[: _LONGEST - 1]}…"
        super().__init__(said)
        self.finding = Mistake(code, said, place)


class Mistake(NamedTuple):
    """One mistake, with the fields of a Finding message."""

    code: str
    message: str
    place: str


def inputs_of(text: str) -> Mapping[str, object]:
    """Return the mapping in a text of YAML or JSON; an empty text is {}.

    Raises GoalRefused.
    """
    data = text.encode("utf-8", "surrogatepass")
    if len(data) > MAX_BYTES:
        size = f"{len(data):,} bytes of inputs"
        raise GoalRefused(
            "INPUTS", f"{size} are more than {MAX_BYTES:,}; put large data into a file"
        )
    if not text.strip():
        return {}
    try:
        source = source_of(data, "inputs")
        node = compose(source)
        if source.findings:
            raise DocumentError(source.findings)
        if not isinstance(node, YamlMapping):
            raise GoalRefused(
                "INPUTS", "inputs are a mapping, such as {pick_at: 2.0}", "inputs:1:1"
            )
        values = data_of(node)
        refuse_large(values)
    except DocumentError as error:
        first = error.findings[0]
        raise GoalRefused(first.code, first.message, str(first.place)) from None
    except (ValueError, RecursionError) as error:
        raise GoalRefused("INPUTS", str(error), "inputs:1:1") from None
    assert isinstance(values, dict)
    return values
