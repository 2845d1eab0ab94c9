"""What a stranger's exception says, whatever it does when it is asked."""

from __future__ import annotations

import pytest

from bt_actions.behaviours.variables import MissingVariable
from bt_actions.utilities.plain_text import in_words


class Mute(Exception):
    """One that raises when it is to say what it is."""

    def __str__(self) -> str:
        raise RuntimeError("not now")


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (ValueError("no variable $pick_at"), "no variable $pick_at"),
        (MissingVariable("variable 'pick_at' has no value"), "variable 'pick_at' has no value"),
        (KeyError("pick_at"), "KeyError: 'pick_at'"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero"),
        (ValueError(), "ValueError"),
        (Mute(), "Mute"),
    ],
    ids=["words", "a variable", "a key", "no sentence", "nothing", "raises"],
)
def test_what_an_exception_says(error: Exception, says: str) -> None:
    assert in_words(error) == says
