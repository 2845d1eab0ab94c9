"""Lines about one goal, in the words of `bt-actions run`. Pure; no ROS, no state."""

from __future__ import annotations

from collections.abc import Mapping

from bt_actions.document import Tree
from bt_actions.events.snapshot import HIDDEN
from bt_actions.serving.catalog import ServedTree
from bt_actions.serving.outcome import RunOutcome
from bt_actions.serving.requests import Mistake
from bt_actions.story.words import begins_text, verdict
from bt_actions.utilities.plain_text import clean

SAME_NAME = "SAME_NAME"


def begins(file: str, tree: Tree, inputs: Mapping[str, object], goal_name: str) -> str:
    """Say what begins: the file, the inputs and the caller's name."""
    given = {each.name: each.default for each in tree.inputs.values()} | dict(inputs)
    given |= {each.name: HIDDEN for each in tree.inputs.values() if each.secret}
    return begins_text(file, given) + clean(f", called {goal_name!r}" if goal_name else "")


def ends(outcome: RunOutcome, seconds: float | None) -> str:
    """Say how a run has ended; `seconds` is None for a run that never began.

    Goals that are not accounted for have their own lines.
    """
    left = "" if outcome.settled else ", and not all of its goals are accounted for"
    why = outcome.why
    before = ":\n" if "\n" in why else ": " if why else ""  # each line of a log has a length
    return f"ends: {verdict(outcome.status, seconds)}{left}{before}{why}"


def warnings_of(entry: ServedTree) -> list[Mistake]:
    """Return the conflicts of a tree's name: other files have the same name."""
    return [
        Mistake(
            SAME_NAME, f"{entry.file} is served as {entry.name!r}, and {each} is not", str(each)
        )
        for each in entry.hides
    ]
