"""Trees and runs as messages of bt_actions_interfaces. No node, no state."""

from __future__ import annotations

from collections.abc import Iterable

from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport, Finding, RunningLeaf, TreeInfo, TreeInput
from builtin_interfaces.msg import Duration
from unique_identifier_msgs.msg import UUID

from bt_actions.events.snapshot import HIDDEN
from bt_actions.goals.policy import End
from bt_actions.serving.catalog import ServedTree
from bt_actions.serving.outcome import ENDS, OUTCOMES, SEPARATOR, RunOutcome
from bt_actions.serving.requests import Mistake
from bt_actions.serving.run import Run
from bt_actions.serving.story import warnings_of
from bt_actions.story.actions import ActionStory
from bt_actions.story.doing import doing
from bt_actions.story.state import NodeStory, State
from bt_actions.utilities.plain_text import as_json

SHOWN = 3
"""Running leaves in a message of feedback."""


def result(outcome: RunOutcome) -> RunTree.Result:
    """Return the answer to a goal."""
    return RunTree.Result(
        error_code=outcome.code,
        error_msg=outcome.message,
        outputs=outcome.outputs,
        settled=outcome.settled,
        actions=[_action(each, outcome.at) for each in outcome.actions],
        recording=outcome.recording,
    )


def feedback(state: State, *, paused: bool, begun: bool) -> RunTree.Feedback:
    """Return the progress of a run."""
    return RunTree.Feedback(
        running=[_leaf(state, each) for each in state.running[:SHOWN]],
        leaves_ended=state.leaves_ended,
        paused=paused,
        waiting=not begun,
    )


def _leaf(state: State, story: NodeStory) -> RunningLeaf:
    path, message = SEPARATOR.join(state.path(story.node.id)), str(doing(state, story))
    if not state.acts(story.node.id):
        return RunningLeaf(path=path, message=message)
    action = state.action(story.node.id)
    return RunningLeaf(path=path, message=message, attempt=action.attempt, attempts=action.of)


def finding(said: Mistake) -> Finding:
    """Return a mistake as a message."""
    return Finding(**said._asdict())


def info(entry: ServedTree, goals: Iterable[tuple[UUID, Run, bool]]) -> TreeInfo:
    """Return a tree; each of its goals comes with its run, and whether that has begun."""
    tree, goals = entry.tree, list(goals)
    return TreeInfo(
        name=entry.name,
        description="" if tree is None else tree.description,
        file=str(entry.file),
        digest=entry.digest,
        state=entry.state.value,
        findings=[finding(each) for each in (*entry.findings, *warnings_of(entry))],
        running=[goal_id for goal_id, _, _ in goals],
        paused=[goal_id for goal_id, run, _ in goals if run.paused],
        waiting=[goal_id for goal_id, _, begun in goals if not begun],
        inputs=[
            TreeInput(
                name=each.name,
                type=each.type,
                unit=each.unit,
                description=each.description,
                required=each.required,
                default_json=""
                if each.required
                else as_json(HIDDEN if each.secret else each.default),
            )
            for each in ({} if tree is None else tree.inputs).values()
        ],
    )


def _action(action: ActionStory, now: float) -> ActionReport:
    duration = action.seconds(now)
    return ActionReport(
        path=SEPARATOR.join(action.path),
        server=action.server,
        attempts=min(action.attempts, 65535),
        outcome=0 if action.outcome is None else OUTCOMES[action.outcome],
        end=ENDS[End.UNKNOWN if action.end is None else action.end],
        reason=action.reason,
        duration=Duration(sec=int(duration), nanosec=int(duration % 1.0 * 1e9)),
        place=action.node.place,
    )
