"""The reason why a run waits, or has failed: the root cause first, with the values behind it.

One function of the state (and of now, while the run goes on) serves every place: the terminal,
`--json`, RunTree's result, the diagnostics, a failed assertion over a VirtualRunner.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from py_trees.common import Status

from bt_actions.events.kinds import Node, RoundBegan, TreeFinished
from bt_actions.events.snapshot import HIDDEN
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import DONE, ActionStory, GoalStory
from bt_actions.story.doing import did_text, doing
from bt_actions.story.failures import Failure
from bt_actions.story.state import State
from bt_actions.story.values import LONG, clock, opened, round_text, unmet_text
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import brief, fit, shorten

LINES = 12
"""Lines of one story in a terminal."""
ATTEMPTS = 3
"""Attempts of one failure with a line of their own: the last ones."""
STOPPED = 2
"""Leaves with a line of their own that one node has stopped."""
BELOW = 5
"""Lines of a run below a RunTree leaf."""
_BELOW = "has failed:"
"""The end of the line before these."""
_FIRST = re.compile(rf"\A(.*)\n  (?:(.*{_BELOW})\n    )?")
"""The path of a cause; for a RunTree leaf, also the text before the cause below."""

_USUAL_ENDS = {
    Outcome.SUCCEEDED: End.SUCCEEDED,
    Outcome.UNEXPECTED_RESULT: End.SUCCEEDED,
    Outcome.ABORTED: End.ABORTED,
    Outcome.CANCELED: End.CANCELED,
    Outcome.CANCELED_BY_OTHER: End.CANCELED,
    Outcome.REJECTED: End.NEVER_STARTED,
    Outcome.SERVER_UNAVAILABLE: End.NEVER_STARTED,
    Outcome.SERVER_AMBIGUOUS: End.NEVER_STARTED,
    Outcome.SERVER_BUSY: End.NEVER_STARTED,
    Outcome.INVALID_GOAL: End.NEVER_STARTED,
    Outcome.SERVER_LOST: End.SERVER_GONE,
}
"""Ends that go without saying."""


def why(state: State, now: float | None = None) -> list[str]:
    """Return why the run waits, or why it has failed; [] for a run that has succeeded.

    `now` is in seconds on the steady clock, and only counts while the run goes on.
    """
    if state.finished is None:
        return waits(state, state.latest if now is None else now)
    stories = [list(_told(failure, state)) for failure in state.failures]
    if state.finished.error:
        stories = [list(_raised(state, state.finished))]
    elif state.status is Status.INVALID and state.stopped:
        stories = [list(_told(each, state)) for each in state.stopped]
        stories[0].insert(0, "stopped while it ran:")
    if not stories:
        return []
    told = f"{state.lost} events were lost to this reader: there may be more to it"
    lost, dealt = [told] if state.lost else [], list(_dealt_with(state))
    if len(stories[0]) + (len(stories) > 1) + len(lost) + len(dealt) > LINES:
        dealt = []  # a long cause comes first
    room = LINES - len(lost) - len(dealt)
    lines: list[str] = []
    for number, cause in enumerate(stories):
        names = [each[0].strip().rpartition(" / ")[2] for each in stories[number:]]
        if lines and len(lines) + len(cause) + (len(names) > 1) > room:
            lines.append(f"and {len(names)} more: {', '.join(names)}")
            break
        lines += cause
    return [fit(line) for line in lines + lost + dealt]


def why_text(state: State, now: float | None = None) -> str:
    """Return the same as one text, for a reader who may show the first line alone.

    That line has the cause and its place in the tree; for a RunTree leaf, the cause below.
    """
    text = "\n".join(why(state, now))
    return _FIRST.sub(lambda line: f"{line[1]}: {f'{line[2]} ' if line[2] else ''}", text)


# During the run


def waits(state: State, now: float) -> list[str]:
    """Return a line for each running leaf, the deepest first: its work, since and until when."""
    running, lines = state.running, list[str]()
    for each in running[:LINES]:
        name = f"{state.called(each.node.id)}{_items(state.rounds(each.node.id))}"
        lines.append(clean(f"{name}: {doing(state, each, now)}"))
    more = len(running) - LINES
    return [*lines[:-1], f"and {more + 1} more"] if more > 0 else lines


# After a failure


def _told(failure: Failure, state: State) -> Iterator[str]:
    """Yield time, place and item of a failure, each attempt, and the nodes that passed it on."""
    items = _items(failure.items)
    yield clean(f"{clock(failure.at.wall)}  {' / '.join(failure.path)}{items}")
    if failure.ran is not None:
        yield clean(f"  {did_text(failure)}")
    if failure.ran is None or failure.attempts:
        yield from _attempts(failure)
    for each in failure.below[:STOPPED]:
        said = each.message
        if each.action is not None and each.attempts:
            said = attempt_text(each.action, each.attempts[-1])
        yield clean(f"  it stopped {state.called(each.node.id)}{f': {said}' if said else ''}")
    if (more := len(failure.below) - STOPPED) > 0:
        yield f"  and {more} more"
    failed = state.status is Status.FAILURE
    holders = failure.holders if failed else ()
    passed = ", ".join(f"{above.name} ({above.kind})" for above in holders)
    place = failure.place or f"{failure.node.name} ({failure.node.kind})"
    yield clean(f"  {place}{f'; passed on by {passed}' if passed else ''}")


def _raised(state: State, finished: TreeFinished) -> Iterator[str]:
    """Yield the time, node and item of an error, the error, and its place."""
    when, story = clock(finished.at.wall), state.nodes.get(finished.culprit or 0)
    if story is None:  # no behaviour's fault
        yield clean(f"{when}  {finished.error}")
        return
    path = " / ".join(state.path(story.node.id))
    yield clean(f"{when}  {path}{_items(state.rounds(story.node.id))}")
    if what := finished.error.removeprefix(path).removeprefix(": "):
        yield clean(f"  {what}")
    yield clean(f"  {story.node.place or f'{story.node.name} ({story.node.kind})'}")


def _attempts(failure: Failure) -> Iterator[str]:
    goals, action = failure.attempts, failure.action
    if action is None or not goals:
        yield clean(f"  failed{f': {failure.message}' if failure.message else ''}")
        return
    answer = opened(goals[-1].result) if action.node.action == "RunTree" else {}
    below, recording = answer.get("error_msg"), answer.get("recording")
    if isinstance(below, str) and below:
        yield clean(f"  {goals[-1].outcome}: the run at {action.server} {_BELOW}")
        yield from (f"    {clean(line)}" for line in below.splitlines()[:BELOW])
        if isinstance(recording, str) and recording:
            yield clean(f"    recorded in {recording}")
        return
    told: list[tuple[int, int, str]] = []
    for goal in goals:
        number, text = goal.latest.attempt, attempt_text(action, goal)
        if told and told[-1][2] == text:
            told[-1] = (told[-1][0], number, text)
        else:
            told.append((number, number, text))
    of = f" of {len(goals)}" if len(told) > ATTEMPTS else ""
    for first, last, text in told[-ATTEMPTS:]:
        which = f"attempt {first}{of}: " if first == last else f"attempts {first} to {last}{of}: "
        yield clean(f"  {which if len(goals) > 1 else ''}{text}")


def attempt_text(action: ActionStory, goal: GoalStory) -> str:
    """Say of one attempt the goal, the result, and the verdict."""
    # an end that stays unknown is told at the end of the run
    is_left = goal.latest.state == DONE and goal.latest.end is End.UNKNOWN
    why_not = unmet_text(goal) or ("" if is_left else goal.reason)
    told = goal.latest.state  # the run was left
    if goal.outcome is not None:
        told = outcome_text(goal.outcome, goal.latest.end, goal.in_doubt)
    told += f": {why_not}" if why_not else ""
    sent = "" if goal.goal in (None, HIDDEN) else shorten(opened(goal.goal), LONG)
    if sent and "goal {" not in told:
        told += f"; goal {sent}"
    if goal.outcome is Outcome.UNEXPECTED_RESULT and goal.result is not None:
        told += f"; result {shorten(opened(goal.result), LONG)}"
    elif goal.feedback is not None and goal.outcome not in (Outcome.ABORTED, Outcome.SUCCEEDED):
        told += f"; last feedback {shorten(opened(goal.feedback.feedback), LONG)}"
    return told


def outcome_text(outcome: Outcome, end: End | None, in_doubt: bool) -> str:
    """Say the outcome of a goal, and its end where that does not follow."""
    if in_doubt:
        return f"{outcome}, not started as far as its server knows"
    if end is None or end is _USUAL_ENDS.get(outcome):
        return f"{outcome}"
    return f"{outcome}, end not known" if end is End.UNKNOWN else f"{outcome}, ended {end}"


def _dealt_with(state: State) -> Iterator[str]:
    """Yield the last dealt-with failures."""
    groups: dict[object, tuple[Failure, int]] = {}  # rounds of one retry are told once
    for failure in state.dealt_with:
        kept = [each for each in failure.items if each[0] is not failure.by]
        key = failure.node.id, tuple((node.id, begun.number) for node, begun in kept)
        groups[key] = failure, groups.pop(key, (failure, 0))[1] + 1
    if not groups:
        return
    are_all = len(groups) <= 2 and len(state.dealt_with) == state.dealt_with_in_all
    yield f"failed before, and dealt with{'' if are_all else ' (the last 2)'}:"
    for failure, times in list(groups.values())[-2:]:
        items = _items(failure.items)
        last = failure.attempts[-1] if failure.attempts else None
        said, tries = failure.message, ""
        if failure.action is not None and last is not None:
            said = attempt_text(failure.action, last)
            tries = f" after {len(failure.attempts)} attempts" if len(failure.attempts) > 1 else ""
        tries += f", {times} times" if times > 1 else ""
        by = f"; {failure.by.name} ({failure.by.kind}) went on" if failure.by is not None else ""
        name = state.called(failure.node.id)
        yield clean(f"  {clock(failure.at.wall)}  {name}{items}, failed{tries}: {brief(said)}{by}")


def _items(rounds: Iterable[tuple[Node, RoundBegan]]) -> str:
    told = (round_text(begun, f" of {loop.name}") for loop, begun in rounds)
    return "".join(f", {each}" for each in told)
