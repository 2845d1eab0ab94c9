"""Lines about one goal, in the words of `bt-actions run`. Pure; no ROS, no state."""

from __future__ import annotations

from collections.abc import Mapping

from bt_actions.document import Tree
from bt_actions.serving.catalog import Entry
from bt_actions.serving.outcome import Code, Ending, RunOutcome
from bt_actions.serving.requests import Said
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import shorten

SAME_NAME = "SAME_NAME"
_LONG = 60
"""Characters of an input's value,"""
_LONGEST = 300
"""and of all of them."""
_STOPPED = tuple(each.value[0] for each in Ending)


def begins(file: str, tree: Tree, inputs: Mapping[str, object], goal_name: str) -> str:
    """Say what begins: its file, its inputs and the caller's name for it."""
    given = {each.name: each.default for each in tree.inputs.values()} | dict(inputs)
    words = ", ".join(f"{name}={shorten(value, _LONG)}" for name, value in given.items())
    if len(words) > _LONGEST:
        words = f"{words[: _LONGEST - 1]}…"
    called = f", called {goal_name!r}" if goal_name else ""
    return clean(f"begins ({file}){' with ' if words else ''}{words}{called}")


def ends(outcome: RunOutcome, seconds: float | None) -> str:
    """Say how a run has ended; `seconds` is None for one that never began."""
    word = "FAILURE"
    if outcome.code in (Code.NONE, Code.UNKNOWN):
        word = "SUCCESS"
    elif outcome.code in _STOPPED:
        word = "STOPPED"
    after = "" if seconds is None else f" after {seconds:.2f} s"
    return f"ends: {word}{after}{f': {outcome.message}' if outcome.message else ''}"


def warnings_of(entry: Entry) -> list[Said]:
    """Return what is wrong with the name of a tree: other files have the same name."""
    return [
        Said(SAME_NAME, f"{entry.file} is served as {entry.name!r}, and {each} is not", str(each))
        for each in entry.hides
    ]
