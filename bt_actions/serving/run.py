"""One run of a served tree: on a thread of its own, from its behaviours to its outcome.

The server owns the node and its executor. Nothing here knows the client.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from py_trees.common import Status

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.document import Tree, tree_outputs
from bt_actions.events import RunEnded, StopWanted
from bt_actions.events.stream import Reader, Stream
from bt_actions.messages.conversion import to_plain
from bt_actions.ros.naming import server_name
from bt_actions.running.runner import TreeRunner
from bt_actions.serving.outcome import Ending, RunOutcome, outcome_of
from bt_actions.story.state import State
from bt_actions.utilities.plain_text import as_json


class Run:
    """A tree that runs, or waits for its turn.

    Args:
        tree: the version that was checked; a newer one does not matter any more.
        inputs: values that were checked with it.
        node: the node that goals are sent from; another thread spins it.
        watch: called with the runner before it runs; returns what tells where the run is recorded.
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
        watch: Callable[[TreeRunner], Callable[[], str]] = lambda _: str,
        asked_by: tuple[str, str] = ("", ""),
        begins: Callable[[set[str]], None],
        ended: Callable[[RunOutcome], None],
    ) -> None:
        self.tree = tree
        self._inputs = inputs
        self._node, self._asked_by, self._watch = node, asked_by, watch
        self._begins, self._ended = begins, ended
        self._recording: Callable[[], str] = str
        self._lock = threading.Lock()
        self._runner: TreeRunner | None = None
        self._stream: Stream | None = None
        self.paused = False
        """Whether no new goal is begun."""
        self.ending: Ending | None = None
        self._state = State()
        self._events: Reader | None = None
        self._thread = threading.Thread(target=self._run, name=f"bt_actions-serve-{tree.name}")
        self._thread.daemon = True  # as that of TreeRunner.start: its goals are drained at exit

    def start(self) -> None:
        """Start the run, and return at once."""
        self._thread.start()

    def end(self, ending: Ending, *, abandon: bool = False) -> None:
        """End the run before its time: cancel and drain its goals. Returns at once.

        `abandon` ends the wait for goals that are being drained.
        """
        with self._lock:
            self.ending = self.ending or ending
            self._stop(ending, abandon=abandon)

    def _stop(self, ending: Ending, *, abandon: bool = False) -> None:
        if self._runner is not None:
            self._runner.stream.add(StopWanted, ending.name, ending.value[1], abandon)
            self._runner.interrupt(abandon=abandon)

    def pause(self, wanted: bool) -> None:
        """Begin no new goal, or begin goals again; running goals go on."""
        with self._lock:
            self.paused = wanted
            if self._runner is not None:
                (self._runner.pause if wanted else self._runner.resume)()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until the run is over, for so many seconds; return whether it is."""
        if self._thread.ident is not None:
            self._thread.join(timeout)
        return not self._thread.is_alive()

    @contextlib.contextmanager
    def told(self) -> Iterator[State]:
        """Give the present state of the run, also while a tick does not return; on any thread."""
        with self._lock:
            for event in self._events.take() if self._events is not None else ():
                self._state.fold(event)
            yield self._state

    # On the run's thread

    def _run(self) -> None:
        try:
            outcome = self._to_end()
        except BaseException as error:  # noqa: BLE001 - the client must get an answer
            outcome = outcome_of(State(), succeeded=False, error=error)
        if self._stream is not None:
            self._stream.add(RunEnded, outcome.code, "", outcome.why, outcome.unaccounted)
        if outcome.code:
            outcome = replace(outcome, recording=self._recording())
        self._ended(outcome)

    def _to_end(self) -> RunOutcome:
        root = self.tree.build(self._inputs)
        leaves = [each for each in root.iterate() if isinstance(each, ActionBehaviour)]
        self._begins({server_name(self._node, each.action_name) for each in leaves})
        status, error = Status.INVALID, None
        runner = TreeRunner(root, node=self._node, asked_by=self._asked_by)
        self._stream = runner.stream
        self._recording = self._watch(runner)
        try:
            with self._lock:
                self._runner, self._events = runner, runner.stream.reader()
                if self.ending is not None:
                    self._stop(self.ending)
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
        with self.told() as state:
            return outcome_of(
                state,
                succeeded=status is Status.SUCCESS,
                ending=None if status is Status.FAILURE else self.ending,
                error=error,
                outputs=outputs,
                unaccounted=[f"{each.name} on {each.server}" for each in runner.unaccounted],
            )
