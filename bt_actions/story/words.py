"""The words of the views: the standing of a goal, the values of a message, the end of a run.

Pure functions of the state; nothing here writes anything.
"""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.common import Status

from bt_actions.events.kinds import Moment, RunEnded
from bt_actions.events.snapshot import Cut, Value
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import ActionStory
from bt_actions.story.doing import goal_doing
from bt_actions.story.state import State
from bt_actions.story.table import table
from bt_actions.story.values import constants_of, named, unmet_text
from bt_actions.story.why import outcome_text, why
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import MESSAGE, brief, fit, shorten
from bt_actions.utilities.suggest import listing

NO_END = RunEnded(Moment(0, 0.0, 0.0, 0.0), 0)
"""The stand-in for the end of a run that has none."""
MOST = 3
"""Actions that are waited for, or items of a list, that a text names."""
MANY = 20
"""Items of a list that is shown whole."""


def begins_text(file: str, inputs: Mapping[str, object]) -> str:
    """Say that a run begins: its file, and its inputs without secrets."""
    words = fit(", ".join(f"{name}={shorten(value, 60)}" for name, value in inputs.items()), 200)
    return clean(f"begins{f' ({file})' if file else ''}{' with ' if words else ''}{words}")


def verdict(status: Status, seconds: float | None) -> str:
    """Say how a run has ended, and after how long; `seconds` is None for a run that never began."""
    word = "STOPPED" if status is Status.INVALID else status.value
    return word if seconds is None else f"{word} after {seconds:.2f} s"


def judged(state: State) -> Status:
    """Return the status of an ended run.

    FAILURE where a behaviour raised, though nobody stopped it.
    """
    raised = state.finished is not None and state.finished.error and state.stop is None
    return Status.FAILURE if raised else state.status


def verdict_on(state: State) -> str:
    """Say how a run has ended, or that it has not finished."""
    if state.finished is None and state.ended is None:
        return f"NOT FINISHED after {state.elapsed:.2f} s"
    return verdict(judged(state), state.elapsed)


def last_words(state: State, width: int = MESSAGE) -> list[str]:
    """Return the table, the verdict, the time, and last the troubles."""
    ended = state.ended or NO_END
    cause = f", {ended.cause}" if ended.cause else ""
    if ended.complaint and state.status is Status.SUCCESS:
        cause += ", but not as it should be"
    return blocks(
        action_table(state, width),
        outputs_lines(state.outputs),
        [ended.world] if ended.world else [],
        [f"{verdict_on(state)}{cause}"],
        troubles(state),
    )


def blocks(*blocks: list[str]) -> list[str]:
    """Return the lines of all blocks, with an empty line before each."""
    return [line for block in blocks if block for line in ("", *block)]


def outputs_lines(outputs: Mapping[str, object]) -> list[str]:
    """Return a line for each output of a tree."""
    return [clean(f"{name}: {brief(value)}") for name, value in outputs.items()]


def action_table(state: State, width: int = MESSAGE) -> list[str]:
    """Return the table of the actions of a run."""
    return table(state.actions, lambda each: state.called(each.node.id), state.latest, width)


def troubles(state: State) -> list[str]:
    """Return the troubles of a run, the gravest last; [] without any."""
    warned = [f"{' / '.join(each.path)}: {each.message}" for each in state.warnings]
    warnings = [fit(f"warning: {clean(line)}") for line in warned]
    return [*warnings, *why(state), *left_open(state)]


def left_open(state: State) -> list[str]:
    """Return the troubles beside the tree, and the unknowns, the gravest last."""
    ended = state.ended or NO_END
    lines = [line for line in (ended.complaint, error_text(state)) if line]
    left = {each.server for each in state.actions if each.left_at_server or each.live}
    if left and not state.simulation:  # simulated servers ended with the run's process
        which = " ".join(["", *sorted(left)]) if len(left) <= MOST else ""
        lines.append(
            "A goal may still run, or run on where its server only stood still: once that is in "
            f"sight, `bt-actions cleanup{which}` cancels it."
        )
    lines += [f"not accounted for: {line}" for line in ended.unaccounted]
    return [fit(clean(line)) for line in lines]


def error_text(state: State) -> str:
    """Say what is wrong with the run beside failures of its tree and errors of behaviours."""
    if state.finished is not None and (state.finished.error or state.failures):
        return ""
    return state.ended.error if state.ended is not None else ""


def goal_text(action: ActionStory) -> str:
    """Say how the latest goal of an action stands."""
    if action.outcome is None:
        return str(goal_doing(action.state, action.server, action.attempt, action.of))
    attempt = f" (attempt {action.attempt})" if action.attempt > 1 else ""
    text = outcome_text(action.outcome, action.end, action.in_doubt)
    if action.end is End.UNKNOWN:  # the goal's own line says why
        return f"{text}{' yet' if action.live else ''}{attempt}"
    if action.outcome is Outcome.SUCCEEDED or action.latest is None:
        return f"{text}{attempt}"
    said = unmet_text(action.latest) or action.reason
    return f"{text}{attempt}{said and f': {said}'}"


def stopping_text(state: State) -> str:
    """Say that the run is asked to end, and the goals that it waits for."""
    assert state.stop is not None
    again = "Ctrl-C again leaves without waiting"
    live = len(state.live)
    if live:
        goals = "1 goal" if live == 1 else f"{live} goals"
        return f"{state.stop.why}: canceling {goals}; {again}"
    waiting = waiting_text(state)
    return f"{state.stop.why}: {waiting}; {again}" if waiting else state.stop.why


def waiting_text(state: State) -> str:
    """Say what a run waits for whose tree has ended; "" when it is over."""
    actions = [action for action in state.actions if action.waited_for]
    if actions:
        goals = sum(action.waited_for for action in actions)
        count = "1 goal" if goals == 1 else f"{goals} goals"
        return f"waiting to know the end of {count}: {_where(state, actions)}"
    actions = [action for action in state.actions if action.left_at_server]
    if actions:
        what = "looking out for a server that went away, to cancel its goal if it is back"
        return f"{what}: {_where(state, actions)}"
    if state.lasting is not None:
        return f"waiting for the tick of {state.called(state.lasting.node)} to return"
    return ""


def _where(state: State, actions: list[ActionStory]) -> str:
    return listing([f"{state.called(each.node.id)} on {each.server}" for each in actions], MOST)


def result_lines(action: ActionStory) -> list[str]:
    """Return the result of an action as lines of YAML, with the beginnings of long values."""
    result = action.latest.result if action.latest is not None else None
    if result is None:
        return []
    import yaml

    constants = constants_of(action, "result")
    text = yaml.safe_dump(_short(result), sort_keys=False, allow_unicode=True)
    lines = []
    for line in text.splitlines():
        field, _, written = line.partition(": ")
        name = named(constants, field, int(written)) if written.isdecimal() else written
        lines.append(f"  {line}" + (f"  # {name}" if name != written else ""))
    return lines


def _short(data: Value) -> object:
    """Return plain data with the first items of long lists, and the beginning of long texts."""
    more = data.more if isinstance(data, Cut) else 0
    data = data.head if isinstance(data, Cut) else data
    if isinstance(data, dict):
        short: dict[str, object] = {key: _short(value) for key, value in data.items()}
        return short | ({"…": f"{more} more"} if more else {})
    if isinstance(data, bytes):
        data = tuple(data)
    if isinstance(data, tuple):
        size = len(data) + more
        rest = [f"… {size} items"] if size > MANY else []
        return [_short(item) for item in (data[:MOST] if rest else data)] + rest
    return brief(data) if isinstance(data, str) else data
