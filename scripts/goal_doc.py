"""Writes docs/goal.md from the transition table in bt_actions/goals/table.py.

`python scripts/goal_doc.py` writes it; with `--check` it exits 1, and says so, when what is there
is stale.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

from bt_actions.goals.facts import Step, drop
from bt_actions.goals.policy import RETRIED_BY_DEFAULT, RETRIED_IF_NAMED, Outcome
from bt_actions.goals.table import TABLE
from bt_actions.goals.terms import Command, Event, State

PATH = Path(__file__).resolve().parent.parent / "docs" / "goal.md"

HEAD = """\
# The life of a goal

<!-- Made by scripts/goal_doc.py from TABLE in bt_actions/goals/table.py. Do not edit. -->

One goal on one action server, from wish to end. `Goal.on` takes each event, also each deadline that
has passed (`Goal.due`), and returns commands. Every pair of state and event is decided. An event
that is not in these tables came too late, or twice, to mean anything, and is dropped.

As a rule a goal is QUEUED, WAITING_FOR_SERVER, SENDING, EXECUTING and DONE; an unwanted goal is
CANCELING before its end. The other states are for faults: a request without an answer, a server
that is lost. A leaf is free as soon as its outcome is decided. Some goals live on after that, so
that they are canceled should they run all the same.

`--json` and the terminal show fewer states: REPLACED as EXECUTING, and UNWANTED, UNCONFIRMED,
PRESUMED_NOT_RECEIVED, NOT_RECEIVED and LOST as CANCELING.
"""
OUTCOMES = {
    Outcome.SUCCEEDED: "the server succeeded, and `expect` holds",
    Outcome.UNEXPECTED_RESULT: "the server succeeded, but `expect` does not hold",
    Outcome.REJECTED: "the server refused the goal",
    Outcome.ABORTED: "the server gave up; its result is kept",
    Outcome.CANCELED: "this process stopped or replaced the goal, whatever its status at the end",
    Outcome.CANCELED_BY_OTHER: "the goal ended as canceled, and this process had not asked for it",
    Outcome.SERVER_UNAVAILABLE: "no server within `timeout.server`",
    Outcome.SERVER_AMBIGUOUS: "two live servers under the name: not sent, or canceled at both; a "
    "process sends no goal in its first second, in which it may see only one server",
    Outcome.SERVER_BUSY: "the resource was not free within `timeout.queue`, or `busy: fail`",
    Outcome.ACCEPT_TIMEOUT: "no answer within `timeout.accept`; the goal may have been executed",
    Outcome.RESULT_TIMEOUT: "not finished within `timeout.result`, and canceled",
    Outcome.STALLED: "no feedback for `timeout.feedback`, and canceled",
    Outcome.SERVER_LOST: "the server died or was restarted under the goal",
    Outcome.INVALID_GOAL: "the message could not be built; nothing was sent",
}
ENDS = """\
A goal's *end* is its standing on its server: SUCCEEDED, ABORTED or CANCELED in the server's words,
NEVER_STARTED where nothing was begun, SERVER_GONE where the server went away with the goal, and
UNKNOWN. An UNKNOWN end is logged, stands in the report, and makes the exit code 3.

`retry.outcomes` has limits: no attempt begins beside a goal whose end is UNKNOWN. After SERVER_GONE
one begins only if SERVER_LOST is named. A goal that has SUCCEEDED is tried again for
UNEXPECTED_RESULT alone.
"""


def steps(state: State) -> dict[Event, Step]:
    """Return the decisions of one state, without what is dropped."""
    return {event: TABLE[state, event] for event in Event if TABLE[state, event] is not drop}


def says(step: Step) -> str:
    """Return a step in words, as they stand in a table."""
    return step.says if step.says[1].isupper() else step.says[0].lower() + step.says[1:]


def diagram() -> str:
    """Return the diagram: an arrow for each pair of states, with the events that take it."""
    arrows: dict[tuple[State, State], list[Event]] = defaultdict(list)
    for state in State:
        for event, step in steps(state).items():
            for to in sorted(step.to - {state}, key=list(State).index):
                arrows[state, to].append(event)
    lines = ["stateDiagram-v2", "    direction TB", f"    [*] --> {State.QUEUED.name}"]
    for (state, to), events in arrows.items():
        label = "<br/>".join(event.name for event in events)
        lines.append(f"    {state.name} --> {to.name}: {label}")
    lines.append(f"    {State.DONE.name} --> [*]")
    return "\n".join(["```mermaid", *lines, "```"])


def table(state: State) -> str:
    """Return the decisions of one state as a table."""
    lines = ["| event | what is done | may lead to |", "|---|---|---|"]
    for event, step in steps(state).items():
        following = " or ".join(to.name for to in State if to in step.to - {state})
        lines.append(f"| {event.name} | {says(step)} | {following} |")
    return "\n".join(lines)


def outcomes() -> str:
    """Return why a leaf may stop, and what is tried again, as a table."""
    lines = ["| outcome of a leaf | when | tried again |", "|---|---|---|"]
    for outcome in Outcome:
        again = "by default" if outcome in RETRIED_BY_DEFAULT else ""
        again = "if named" if outcome in RETRIED_IF_NAMED else again
        lines.append(f"| {outcome} | {OUTCOMES[outcome]} | {again} |")
    return "\n".join(lines)


def page() -> str:
    """Return the whole page."""
    parts = [HEAD, diagram(), "## Outcomes and ends", outcomes(), ENDS, "## States"]
    for state in State:
        parts += [f"### {state.name}", state.value, table(state)]
    parts += ["## Events", "| event | meaning |\n|---|---|"]
    parts[-1] += "".join(f"\n| {event.name} | {event.value} |" for event in Event)
    parts += ["## Commands", "| command | what the caller does |\n|---|---|"]
    parts[-1] += "".join(f"\n| {command.name} | {command.value} |" for command in Command)
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


def main() -> None:
    """Write the page, or check it."""
    fresh = page()
    if sys.argv[1:] == ["--check"]:
        if not PATH.exists() or PATH.read_text(encoding="utf-8") != fresh:
            sys.exit(f"{PATH} is stale: run `python scripts/goal_doc.py`")
        return
    PATH.parent.mkdir(exist_ok=True)
    PATH.write_text(fresh, encoding="utf-8")


if __name__ == "__main__":
    main()
