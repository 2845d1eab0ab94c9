"""One run of a served tree: on a thread of its own, from its behaviours to its outcome.

The node and its executor are somebody else's. Nothing here knows who asked for the run.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from bt_actions_interfaces.msg import RunningLeaf
from py_trees.common import Status

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.document import Tree, tree_outputs
from bt_actions.events import Event, NodeChanged, RunEnded, StopWanted
from bt_actions.messages.conversion import to_plain
from bt_actions.recording.recorder import Recorder
from bt_actions.ros.naming import server_name
from bt_actions.running.runner import TreeRunner
from bt_actions.serving.outcome import SEPARATOR, Ending, RunOutcome, outcome_of
from bt_actions.story.state import OVER, NodeStory, State
from bt_actions.story.words import doing_text
from bt_actions.utilities.plain_text import as_json

SHOWN = 3
"""Running leaves that are told of."""


class Run:
    """A tree that runs, or waits for its turn.

    Args:
        tree: the version that was checked; a newer one does not matter any more.
        inputs: values that were checked with it.
        node: where goals are sent from; somebody spins it.
        recorder: records the run.
        asked_by: the id of the RunTree goal, and of the run whose leaf sent it.
        begins: called with the full names of the servers that it uses, before it sends a goal.
        ended: called with the outcome, on the run's own thread, when all is over.
    """

    def __init__(
        self,
        tree: Tree,
        inputs: Mapping[str, object],
        node: Any,
        *,
        recorder: Recorder | None = None,
        asked_by: tuple[str, str] = ("", ""),
        begins: Callable[[set[str]], None],
        ended: Callable[[RunOutcome], None],
    ) -> None:
        self.tree = tree
        self._inputs = inputs
        self._node, self._asked_by, self._recorder = node, asked_by, recorder
        self._begins, self._ended = begins, ended
        self._lock = threading.Lock()
        self._runner: TreeRunner | None = None
        self.paused = False
        """No new goal is begun."""
        self.ending: Ending | None = None
        self.leaves_ended = 0
        self._state = State()
        self.changes = 0
        """How often something has changed that is told of while it runs."""
        self._thread = threading.Thread(target=self._run, name=f"bt_actions-serve-{tree.name}")
        self._thread.daemon = True  # as that of TreeRunner.start: what it leaves is drained at exit

    def start(self) -> None:
        """Run. Returns at once."""
        self._thread.start()

    def end(self, ending: Ending, *, abandon: bool = False) -> None:
        """End the run before its time: its goals are canceled and drained. Returns at once.

        With `abandon`, goals that are being drained are waited for no longer.
        """
        with self._lock:
            self.ending = self.ending or ending
            if self._runner is not None:
                self._runner.stream.add(StopWanted, ending.name, ending.value[1], abandon)
                self._runner.interrupt(abandon=abandon)

    def pause(self, wanted: bool) -> None:
        """Begin no new goal, or begin goals again; goals that run go on."""
        with self._lock:
            self.paused = wanted
            self.changes += 1
            if self._runner is not None:
                (self._runner.pause if wanted else self._runner.resume)()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until the run is over, for so many seconds; return whether it is."""
        if self._thread.ident is not None:
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def running(self) -> list[RunningLeaf]:
        """The leaves that run, deepest first; on any thread."""
        with self._lock:
            return [self._leaf(each) for each in self._state.running[:SHOWN]]

    def retrying(self) -> bool:
        """Whether an action that runs is not at its first attempt; on any thread."""
        with self._lock:
            state = self._state
            return any(
                state.acts(each.node.id) and state.action(each.node.id).attempt > 1
                for each in state.running
            )

    def _leaf(self, story: NodeStory) -> RunningLeaf:
        path = SEPARATOR.join(self._state.path(story.node.id))
        told = RunningLeaf(path=path, message=doing_text(story, self._state))
        if self._state.acts(story.node.id):
            action = self._state.action(story.node.id)
            told.attempt, told.attempts = action.attempt, action.of
        return told

    # On the run's thread

    def _run(self) -> None:
        try:
            outcome = self._to_end()
        except BaseException as error:  # noqa: BLE001 - whoever asked for it must be answered
            outcome = outcome_of(State(), succeeded=False, error=error)
        self._ended(outcome)

    def _to_end(self) -> RunOutcome:
        root = self.tree.build(self._inputs)
        leaves = [each for each in root.iterate() if isinstance(each, ActionBehaviour)]
        self._begins({server_name(self._node, each.action_name) for each in leaves})
        status, error = Status.INVALID, None
        runner = TreeRunner(root, node=self._node)
        runner.asked_by = self._asked_by
        runner.observe(self._note)
        if self._recorder is not None:
            self._recorder.record(runner.stream, runner.ticks_since)
        try:
            with self._lock:
                self._runner = runner
                if self.ending is not None:
                    runner.interrupt()
                if self.paused:
                    runner.pause()
            status = runner.run()
        except BaseException as raised:  # noqa: BLE001 - a behaviour's, or nobody spins the node
            error = raised
        finally:
            with self._lock:
                self._runner = None
            runner.shutdown()
        outputs = "{}"
        if status is Status.SUCCESS:
            try:
                outputs = as_json(
                    {name: to_plain(each) for name, each in tree_outputs(root).items()}
                )
            except Exception as raised:  # noqa: BLE001 - a python: node may write anything
                status, error = Status.INVALID, raised
        outcome = outcome_of(
            self._state,
            succeeded=status is Status.SUCCESS,
            ending=None if status is Status.FAILURE else self.ending,
            error=error,
            outputs=outputs,
            unaccounted=[f"{each.name} on {each.server}" for each in runner.unaccounted],
        )
        runner.stream.add(RunEnded, outcome.code, "", outcome.why, outcome.unaccounted)
        return outcome

    def _note(self, event: Event) -> None:
        with self._lock:
            self._state.observe(event)
            if isinstance(event, NodeChanged) and self._state.nodes[event.node].is_leaf:
                self.leaves_ended += event.status in OVER
                self.changes += 1
