"""`TreeServer`: trees as an action of a node, for other nodes to run by their names.

The node and its executor are the user's. catalog.py has the trees, turns.py the turns of goals, and
run.py one run; this file connects them with ROS.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.srv import CheckTree, ControlTree, ListTrees

from bt_actions.document import Tree
from bt_actions.document.reading.find import tree_folder
from bt_actions.recording.recorder import Recorder
from bt_actions.ros.rosout import Level, Rosout
from bt_actions.ros.run_topics import RunTopics
from bt_actions.ros.serving.action_server import DeferredActionServer
from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.ros.serving.lifecycle import Lifecycle
from bt_actions.ros.serving.precedence import Precedence
from bt_actions.running.runner import TreeRunner
from bt_actions.serving.catalog import Catalog, ServedTree
from bt_actions.serving.control import control
from bt_actions.serving.diagnostics import Diagnostics, TreeStanding
from bt_actions.serving.goal import FASTEST, ServedGoal
from bt_actions.serving.messages import finding, info, result
from bt_actions.serving.outcome import Code, Ending, RunOutcome
from bt_actions.serving.rejections import ECHO, Rejections
from bt_actions.serving.requests import GoalRefused
from bt_actions.serving.run import Run
from bt_actions.serving.story import begins, ends, warnings_of
from bt_actions.serving.turns import Policy, Turns
from bt_actions.serving.underway import Underway
from bt_actions.utilities.plain_text import clean, in_words

RESULT_TIMEOUT = 60
"""Seconds for which an ended goal's result can be asked for; each kept result makes a goal
slower."""
_LAST_WORDS = 2.0
"""Seconds for the last results to be sent when the server is closed."""
_LINGER = 0.25
"""Seconds for a client whose goal was just accepted to ask for the result."""


_Admitted = tuple[ServedTree, Tree, Mapping[str, object]]
"""The tree and inputs of an admitted goal, before its client knows."""


class TreeServer:
    """A server of `run_tree`, with services by which others list, check and control trees.

    Args:
        node: the node of the action, and of the goals of the trees. Spin it, in any executor, on
            another thread than the one that makes or closes the server.
        trees: folders of trees, or ``package://NAME/trees``; a tree's name is its file's. Other
            files are read only where they are linked there.
        policy: what to do with a goal while another runs: "reject", "queue", "replace", "parallel".
        most: how many goals may wait (queue), or run (parallel).
        python: the packages whose classes the trees' ``python:`` nodes may name.
        managed: be unconfigured at first, and have the services of a managed node; `lifecycle`
            changes the state from here. Otherwise goals are accepted at once.
        recorder: records each run; closed with the server.
        publish_values: tell subscribers of ``~/events`` and ``~/tree`` goals, results, variables
            and the like, too; secrets never.

    Names, relative to the node: the action ``run_tree``; the services ``~/list_trees``,
    ``~/check_tree`` and ``~/control_tree``; the topics ``~/events`` and ``~/tree`` of the runs, and
    ``~/rejections``, which keeps the last ten.

    Close the server while its node is spun, and before its context is shut down (as rclpy's own
    handler of Ctrl-C does): otherwise the trees' goals are drained all the same, and no client is
    answered.

    Raises NotADirectoryError for a folder that is none, TreeNotFoundError for a package without it,
    ValueError for a policy that is none.
    """

    def __init__(
        self,
        node: Any,
        *,
        trees: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
        policy: Policy | str = Policy.REJECT,
        most: int = 10,
        python: Iterable[str] = (),
        managed: bool = False,
        recorder: Recorder | None = None,
        publish_values: bool = False,
    ) -> None:
        folders = [trees] if isinstance(trees, str | os.PathLike) else list(trees)
        self.node = node
        self._folders = Catalog(map(tree_folder, folders)).folders
        self._python = tuple(python)
        self._recorder = recorder
        self.catalog = Catalog(())
        self._lock = threading.RLock()
        self._answered = threading.Condition(self._lock)
        self.unaccounted: list[str] = []
        """A line for each goal of a tree whose end is not known."""
        self.stuck: list[str] = []
        """A line for each run that was left, as it did not end after `abandon`."""
        self._abandoned = threading.Event()
        self._turns: Turns[ServedGoal] = Turns(Policy(policy), most)
        self._goals: dict[bytes, ServedGoal] = {}
        self._canceled_early: set[bytes] = set()
        self._refuses = "it is unconfigured"
        self._last: dict[str, RunOutcome] = {}
        self._underway = Underway(node.context.get_domain_id())
        self._worker = ThreadPoolExecutor(1, "bt_actions-check")
        self._endpoints = endpoints = Endpoints(node)
        self._rosout = Rosout(node)
        self._say = self._rosout.tell
        self._topics = RunTopics(node, values=publish_values)
        self._rejections = Rejections(endpoints, self._say)
        self.precedence = Precedence(endpoints, "run_tree", self._say)
        self._action = DeferredActionServer(
            endpoints,
            RunTree,
            "run_tree",
            admit=self._on_goal,
            accepted=self._on_accepted,
            dropped=self._on_dropped,
            cancel=self._on_cancel,
            yields=self.precedence.yields,
            keeps=RESULT_TIMEOUT,
        )
        silent = self.precedence.is_doubled
        endpoints.service(ListTrees, "~/list_trees", self._on_list, silent=silent)
        endpoints.service(CheckTree, "~/check_tree", self._on_check, silent=silent)
        endpoints.service(ControlTree, "~/control_tree", self._on_control, silent=silent)
        self._timer = endpoints.timer(FASTEST, self._tell, autostart=False)
        Diagnostics(endpoints, self._standings, self._worker.submit, self.precedence.yields)
        self.lifecycle: Lifecycle | None = None
        if managed:
            steps = {
                "configuring": self._configure,
                "activating": self._activate,
                "deactivating": lambda: self.halt(Ending.DEACTIVATED, "it is inactive"),
                "cleaningup": self._forget,
                "shuttingdown": self._finalize,
            }
            self.lifecycle = Lifecycle(endpoints, steps, self._say)
        else:
            self._configure()
            self._activate()

    def close(self) -> None:
        """Accept no more goals, end all runs, answer their goals, and destroy the server.

        Returns when every goal has ended, or its `timeout.cancel` has passed; not on a thread of
        the node's executor.
        """
        if self.lifecycle is not None:
            self.lifecycle.stop()
        self.halt(Ending.SERVER_ENDS)
        with contextlib.suppress(RuntimeError):  # of an interpreter that ends
            wait([self._worker.submit(int)], _LAST_WORDS)  # until its last work is done
        time.sleep(_LINGER)
        self._rosout.close()
        self._topics.close()
        self._endpoints.close()
        self._action.destroy()
        if self.lifecycle is not None:
            self.lifecycle.close()
        self._worker.shutdown(wait=False, cancel_futures=True)
        if self._recorder is not None:
            self._recorder.close()

    def halt(self, ending: Ending = Ending.HALTED, why: str = "it ends") -> None:
        """Accept no more goals, and end all runs; returns when they have ended."""
        with self._answered:
            self._refuses = why
            # Admitted goals come now, if a thread spins the node, and end as they come.
            self._answered.wait_for(lambda: not self._turns.expected, _LAST_WORDS)
            goals = list(self._goals.values())
        for goal in goals:  # first of all, so that none begins as another ends
            goal.run.end(ending)
        for goal in goals:
            self._end(goal, ending)
        for goal in goals:
            while not goal.run.join(FASTEST):
                if self._abandoned.is_set() and not goal.run.join(_LAST_WORDS):
                    self.stuck.append(f"{goal.tree}: a behaviour does not return from its tick")
                    break
        with self._answered:
            self._answered.wait_for(lambda: not self._goals, _LAST_WORDS)

    def abandon(self) -> None:
        """Have `halt` and `close` wait for no goal any more.

        `unaccounted` names those that are left.
        """
        self._abandoned.set()
        for goal in list(self._goals.values()):
            goal.run.end(Ending.DEACTIVATED, abandon=True)

    # A managed node's life

    def _configure(self) -> None:
        self.catalog = Catalog(self._folders, python=self._python)
        for entry in self.catalog.entries():  # each file is read once, and its mistakes are known
            for warning in warnings_of(entry):
                self._say("warn", warning.message)
        self._refuses = "it is inactive"

    def _activate(self) -> None:
        if self.lifecycle is not None:
            self.precedence.look_first()
        self._refuses = ""

    def _forget(self) -> None:
        self._refuses, self.catalog = "it is unconfigured", Catalog(())
        self._last = {}

    def _finalize(self) -> None:
        self.halt(Ending.DEACTIVATED, "it is finalized")
        self.catalog = Catalog(())

    def _standings(self) -> tuple[list[TreeStanding], str]:
        entries = self.catalog.entries()
        with self._lock:
            goals = [goal for goal in self._turns.running if goal.begun]
            found = []
            for entry in entries:
                runs = [goal.run for goal in goals if goal.tree == entry.name]
                standing = TreeStanding(entry.name, entry.state, last=self._last.get(entry.name))
                for run in runs:
                    with run.told() as state:
                        standing = standing.beside(state, paused=run.paused)
                found.append(standing)
            return found, self._refuses or self.precedence.why

    # Requests; on the executor's threads

    async def _on_goal(self, goal: RunTree.Goal) -> _Admitted | None:
        try:
            self._refuse_more()
            admitted: _Admitted = await self._off(self.catalog.check, goal.tree, goal.inputs)
            with self._lock:  # other goals may have been admitted meanwhile
                self._refuse_more()
                self._turns.expected += 1
        except GoalRefused as refused:
            self._rejections.tell(goal, refused)
            return None
        return admitted

    def _refuse_more(self) -> None:
        with self._lock:
            self._refuse_inactive()
            if refusal := self._turns.refusal():
                raise GoalRefused("BUSY", refusal)

    def _refuse_inactive(self) -> None:
        if why := self._refuses or self.precedence.why:
            raise GoalRefused("INACTIVE", f"this server accepts no goals: {why}")

    def _on_accepted(self, client: Any, admitted: _Admitted) -> None:
        entry, tree, inputs = admitted
        run = Run(
            tree,
            inputs,
            self.node,
            watch=self._watch,
            asked_by=(bytes(client.goal_id.uuid).hex(), client.request.caller_run[:ECHO]),
            ended=lambda outcome: self._ended(goal, outcome),
            begins=lambda servers: self._underway.begins(goal.id, servers),
        )
        begin = begins(str(entry.file), tree, inputs, clean(client.request.goal_name)[:ECHO])
        goal = ServedGoal(client, run, entry.name, begin)
        with self._answered:
            self._goals[goal.id] = goal
            begun, halted = self._turns.come(goal)
            self._answered.notify_all()
            refuses, canceled = self._refuses, goal.id in self._canceled_early
            self._canceled_early.discard(goal.id)
        for each in halted:
            self._end(each, Ending.REPLACED)
        if canceled:
            self._end(goal, Ending.CANCELED)
        if refuses:  # the goal was admitted before
            self._end(goal, Ending.DEACTIVATED)
        self._begin(begun)

    def _on_dropped(self, goal_id: bytes) -> None:
        with self._answered:
            self._canceled_early.discard(goal_id)
            self._turns.expected -= 1
            self._answered.notify_all()

    def _on_cancel(self, client: Any) -> None:
        goal_id = bytes(client.goal_id.uuid)
        with self._lock:
            goal = self._goals.get(goal_id)
            if goal is None:
                self._canceled_early.add(goal_id)  # `_on_accepted` or `_on_dropped` is to come
        if goal is not None:
            self._end(goal, Ending.CANCELED)

    async def _on_list(self, _: Any, response: ListTrees.Response) -> ListTrees.Response:
        entries = await self._off(self.catalog.entries)
        with self._lock:
            goals = list(self._goals.values())
        there = [(each.tree, (each.client.goal_id, each.run, each.begun)) for each in goals]
        response.trees = [
            info(entry, [goal for tree, goal in there if tree == entry.name]) for entry in entries
        ]
        return response

    async def _on_check(
        self, request: CheckTree.Request, response: CheckTree.Response
    ) -> CheckTree.Response:
        try:
            self._refuse_inactive()
            await self._off(self.catalog.check, request.tree, request.inputs)
            self._refuse_more()
        except GoalRefused as refused:
            response.findings = [finding(refused.finding)]
        response.accepted = not response.findings
        return response

    def _on_control(
        self, request: ControlTree.Request, response: ControlTree.Response
    ) -> ControlTree.Response:
        def halt(goal: ServedGoal) -> None:
            self._end(goal, Ending.HALTED)

        return control(request, response, dict(self._goals), halt, self._tell_of)

    async def _off(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Do slow work on the worker's thread, not on the executor's."""
        return await self._endpoints.off(self._worker.submit, lambda: work(*arguments))

    # Runs

    def _begin(self, goals: Iterable[ServedGoal]) -> None:
        for goal in goals:
            with self._lock:  # the timer's callback stops it where nothing has begun
                goal.begun_at = time.monotonic()
                self._timer.reset()
            self._action.begin(goal.client)
            self._tell_of(goal, goal.begins)
            goal.run.start()

    def _watch(self, runner: TreeRunner) -> Callable[[], str]:
        self._topics.follow(runner.stream)
        if self._recorder is None:
            return str
        return self._recorder.record(runner.stream, runner.ticks_since).place

    def _end(self, goal: ServedGoal, ending: Ending) -> None:
        """End a goal before its time, also one that waits for its turn."""
        goal.run.end(ending)
        with self._lock:
            waits = goal in self._turns.waiting
            if waits:
                self._turns.leave(goal)
        if waits:
            code, words = ending.value
            outcome = RunOutcome(int(code), f"{words} before it began")
            self._worker.submit(self._ended, goal, outcome)  # not here: this may be a callback

    def _ended(self, goal: ServedGoal, outcome: RunOutcome) -> None:
        """Answer the goal of a run that is over, and begin the next run."""
        seconds = None if goal.begun_at is None else time.monotonic() - goal.begun_at
        self._tell_of(goal, ends(outcome, seconds), "info" if outcome.as_wanted else "error")
        for each in outcome.unaccounted:  # the log has it from the traffic
            self._rosout.say("error", f"{goal.label} may still be running: {each}")
        self._last[goal.tree] = outcome
        if outcome.settled:
            self._underway.ends(goal.id)
        with self._lock:  # the client may send its next goal as soon as this is answered
            begun = self._turns.leave(goal)
        try:
            self._answer(goal, outcome)
        except Exception as error:  # noqa: BLE001 - the context was shut down before; by version
            self._tell_of(goal, f"its client could not be answered: {in_words(error)}", "warn")
        with self._answered:
            self.unaccounted += outcome.unaccounted
            self._goals.pop(goal.id, None)
            self._answered.notify_all()
        self._begin(begun)

    def _tell_of(self, goal: ServedGoal, text: str, level: Level = "info") -> None:
        self._say(level, f"{goal.label} {text}")

    def _answer(self, goal: ServedGoal, outcome: RunOutcome) -> None:
        status = GoalStatus.STATUS_ABORTED
        if outcome.code == Code.NONE:
            status = GoalStatus.STATUS_SUCCEEDED
        elif outcome.code == Code.CANCELED and outcome.settled:
            status = GoalStatus.STATUS_CANCELED
        self._action.answer(goal.client, result(outcome), status)

    def _tell(self) -> None:
        """Send feedback on their runs to the clients; the timer's callback."""
        with self._lock:
            goals = [*self._turns.running, *self._turns.waiting]
            if not any(goal.begun for goal in goals):
                self._timer.cancel()
        now = time.monotonic()
        for goal in goals:
            goal.tell(now)
