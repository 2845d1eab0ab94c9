"""A py_trees leaf that sends a goal to a ROS action and stays RUNNING until its outcome stands.

The leaf keeps py_trees' contract to the letter (`setup(node=...)`, initialise, update, terminate,
shutdown), and any program may tick it. A tick never blocks. ROS is first touched in `setup`. This
file has the visit to the leaf and its attempts. goals/ decides the course of a goal. The head of
traffic/__init__.py tells how a goal goes out, and how an answer comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from operator import is_not
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.connected import Connected
from bt_actions.behaviours.following import ON_CHANGE, Following
from bt_actions.behaviours.places import root_of
from bt_actions.behaviours.reading import Reading, of_failure, of_feedback
from bt_actions.behaviours.variables import reads_variables
from bt_actions.events.kinds import AttemptEnded
from bt_actions.events.snapshot import HIDDEN
from bt_actions.events.teller import current_teller
from bt_actions.goals.attempts import AttemptRecord, Attempts
from bt_actions.goals.policy import Busy, End, Outcome, Retry, Timeouts
from bt_actions.messages.conversion import MessageError, fill
from bt_actions.messages.fields import fields_in_words
from bt_actions.messages.interfaces import interface
from bt_actions.story.doing import goal_doing
from bt_actions.traffic.backend import Backend
from bt_actions.traffic.drain import drain
from bt_actions.utilities.shorten import shorten

if TYPE_CHECKING:
    from bt_actions.traffic.state import Endpoint, GoalHandle


@dataclass(frozen=True, slots=True)
class Progress:
    """The work of an action at this moment."""

    state: str
    """The goal's state; IDLE before the first visit, BACKOFF between two attempts."""
    attempt: int
    attempts: int
    feedback: Any
    """The latest feedback message, or None."""
    seconds_left: float | None
    deadline: str
    """The field of Timeouts that `seconds_left` belongs to, or ``backoff``."""


class ActionBehaviour(Following, Connected["Endpoint"], Behaviour):
    """A leaf that sends one goal, tries again as `retry` says, and ends in SUCCESS or FAILURE.

    While the leaf runs, `feedback_message` has the goal's state and its latest feedback in short.

    Args:
        name: as in py_trees; the tree language wants it without a colon.
        action_type: the action's class, or its type name (``"pkg/action/Name"``).
        action_name: of the server; a relative name is expanded with the node's namespace.
        goal: a goal message, a mapping of its fields, or a callable without arguments that returns
            either. In a mapping, `Var` stands for a value on the blackboard. All of this is
            evaluated when a goal is sent, for each attempt anew.
        timeout: deadlines in seconds; a bare number is the result's, None means the defaults.
        retry: how often and when to try again; a bare number is the attempts in all.
        expect: a condition on the result, beyond the server's word: a callable on the message, or
            an expression over ``result`` and blackboard variables (``result.stalled``).
        save: blackboard keys, each with its value on success: an expression as for `expect`
            (``{"final_pose": "result.final_pose"}``), or a function of the result. A ValueError
            makes the result an unexpected one.
        save_on_failure: as `save`, for a visit that fails; `outcome` says why. A value that the
            failure lacks stays that of an empty result, which a visit begins with.
        save_feedback: as `save`, of each feedback message, behind the question of `until`. A value
            that a message lacks stays.
        busy: what to do when the resources are taken: wait, replace, fail or share.
        resources: the names that the goal occupies, in place of the action server; named as
            servers are, so a relative name is expanded with the node's namespace.
        until: a condition on each feedback message, as `expect` is on the result: where it holds,
            the goal is canceled. The leaf succeeds when the goal has ended as canceled or
            succeeded; `expect` is not asked then. After any other end, no attempt follows.
        on_change: what to do with an executing goal where its fields, computed anew at each tick,
            have changed: ignore that, `replace` the goal by another one at once, or `cancel` the
            goal, and send another one when it has ended. The leaf stays RUNNING, and only the end
            of the newest goal counts; `timeout.result` runs on, and no attempt is used.
        on_feedback: called with each feedback message, on the ticking thread, before the outcome
            is seen; the newest 100 messages between two ticks, or during one, are kept.

    Raises ValueError for a policy, an expression or a place that makes no sense.
    """

    in_words = "action"
    __slots__ = ("_attempts", "_handle", "_left_behind", "_outcome", "_reading", "_shown")

    def __init__(
        self,
        name: str,
        action_type: type | str,
        action_name: str,
        goal: Any,
        *,
        timeout: Timeouts | float | None = None,
        retry: Retry | int = 1,
        expect: Callable[[Any], bool] | str | None = None,
        save: Mapping[str, str | Callable[[Any], Any]] | None = None,
        save_on_failure: Mapping[str, str | Callable[[Any], Any]] | None = None,
        save_feedback: Mapping[str, str | Callable[[Any], Any]] | None = None,
        until: Callable[[Any], bool] | str | None = None,
        busy: Busy | str = "wait",
        resources: Iterable[str] | None = None,
        on_change: str = "ignore",
        on_feedback: Callable[[Any], None] | None = None,
    ) -> None:
        super().__init__(name)
        if on_change not in ON_CHANGE:
            raise ValueError(f"on_change is one of {', '.join(ON_CHANGE)}, not {on_change!r}")
        if isinstance(resources, str):
            raise ValueError("resources must be a collection of names, not one text")
        self.action_type = action_type
        self.action_name = action_name
        self.goal = goal
        self.timeouts = Timeouts.of(timeout)
        self.retry = Retry.of(retry)
        self.busy = Busy(busy)
        self.resources = frozenset(resources or ())
        self.on_change = on_change
        if on_change != "ignore":
            self.asks = True  # the fields are computed at each tick
        self.on_feedback = on_feedback
        self.expect = expect
        self.save = dict(save or {})
        self._of_failure = None
        if save_on_failure:
            self._of_failure = Reading(None, save_on_failure, names=of_failure)
        self._of_feedback = None
        if save_feedback or until is not None:
            self._of_feedback = Reading(until, save_feedback or {}, names=of_feedback)
        self._reading = Reading(expect, self.save, self.retry.when, self.names)
        self._shown: tuple[tuple[Any, Any, Any], str] = (None, None, None), ""
        self._handle: GoalHandle | None = None
        self._left_behind: list[GoalHandle] = []
        self._attempts = Attempts(self.retry, self._reading.when)
        self._outcome: Outcome | None = None

    # State for callers, to be read after a tick

    @property
    def outcome(self) -> Outcome | None:
        """The outcome of the last visit; None during a visit, and before the first."""
        return self._outcome

    @property
    def end(self) -> End | None:
        """The end of the last goal, as far as is known by now."""
        return self._handle.goal.end if self._handle is not None else None

    @property
    def result(self) -> Any:
        """The last result message, also of a goal that failed; None without one."""
        return self._handle.goal.result if self._handle is not None else None

    @property
    def attempt(self) -> int:
        """The number of the attempt of this visit, from 1; 0 before the first."""
        under_way = self._handle is not None and not self._is_recorded(self._handle)
        return len(self.history) + under_way

    @property
    def history(self) -> list[AttemptRecord]:
        """One record for each attempt of this visit that is over."""
        return self._attempts.history

    @property
    def reason(self) -> str:
        """The outcome in words, or an empty text."""
        return history[-1].reason if (history := self.history) else ""  # this visit's alone

    @property
    def expected(self) -> str:
        """The condition on a result, as it was written; or ""."""
        return self._reading.wanted

    @property
    def server(self) -> str:
        """The action's fully qualified name, once set up; before that the given name."""
        return str(self._own.name) if self._own is not None else self.action_name

    def progress(self) -> Progress:
        """Return the work of the action at this moment; safe to call from any thread."""
        handle, backend = self._handle, self._backend
        state, feedback, left, deadline = "IDLE", None, None, ""
        if backend is not None and handle is not None:
            now = backend.now()
            if self.status is Status.RUNNING and self._is_recorded(handle):
                left = self._attempts.pause_left(now, look_only=True)
                state, deadline = "BACKOFF", "backoff"
            else:
                state, feedback = handle.goal.state.shown, handle.goal.feedback
                if due := backend.traffic.deadline(handle, now):
                    deadline, left = due[0].name.removesuffix("_DUE").lower(), due[1]
        return Progress(state, self.attempt, self.retry.attempts, feedback, left, deadline)

    @property
    def drained(self) -> bool:
        """Whether every goal this leaf has sent so far is accounted for."""
        return all(handle.accounted_for for handle in self.open_handles())

    @property
    def draining(self) -> bool:
        """Whether a goal of this leaf has yet to end, within its deadlines."""
        return any(handle.goal.outcome is None for handle in self.open_handles())

    def due_in(self) -> float | None:
        """Return the seconds until this leaf needs a tick of its own accord.

        None: it needs none.
        """
        if self._backend is None or self._handle is None or not self._is_recorded(self._handle):
            return None  # while a goal is open, traffic/driver.py applies its deadlines
        return self._attempts.pause_left(self._backend.now())

    # py_trees' contract

    def setup(self, **kwargs: Any) -> None:
        """Connect to the action, on the node given as ``node=``.

        A second call for the node is fine.

        Raises TypeError without a node, or when the name is in use with another type; ValueError
        for a name that ROS refuses, for constants that are no goal of this action, and for a field
        that its result lacks; UnknownInterface (a LookupError) when the action type is not
        installed.
        """
        action: Any = interface(self.action_type, "action")
        if isinstance(self.goal, Mapping) and not reads_variables(self.goal):
            try:
                fill(action.Goal, self.goal)
            except MessageError as error:
                raise ValueError(f"{self.name}: goal: {error}") from error
        result, feedback = action.Result, action.Feedback
        parts = (self._reading, result), (self._of_failure, result), (self._of_feedback, feedback)
        for each, part in parts:
            if each is not None and (wrong := each.set_up(part)):
                raise ValueError(f"{self.name}: {wrong}")
        if self._of_failure is not None:
            self._of_failure.save((action.Result(), ""))
        self.action_type = action
        super().setup(**kwargs)

    def _make(self, backend: Backend) -> Endpoint:
        return backend.traffic.endpoint(self.action_type, self.action_name)

    def initialise(self) -> None:
        """Begin a visit. Goals that an earlier visit left behind are drained beside it."""
        backend, _ = self._connection()
        ActionBehaviour.terminate(self, Status.INVALID)  # after a first tick that broke off
        self._attempts = Attempts(self.retry, self._reading.when)
        self._outcome = None
        self._is_enough = False
        if self._of_failure is not None:
            self._of_failure.save((self.action_type.Result(), ""))
        self._begin(backend)

    def update(self) -> Status:
        """Take the goal as far as it goes at this moment; begin one attempt at most."""
        backend, _ = self._connection()
        if self._outcome is not None:
            self.initialise()  # shut down while RUNNING, and set up again: another visit
        handle = self._handle
        assert handle is not None
        begun = False
        while True:
            if self._is_recorded(handle):
                left = self._attempts.pause_left(backend.now())
                if left > 0.0 or begun:
                    self.feedback_message = f"{self.reason}; again in {left:.1f} s"
                    return Status.RUNNING
                handle, begun = self._begin(backend), True
            backend.traffic.advance(handle, self._make_message, self._is_plain)
            decided = handle.is_decided  # then all of its feedback is here
            for _ in range(len(handle.feedback)):  # no later ones: a tick must end
                message = handle.feedback.popleft()
                if self.on_feedback is not None and not self._is_over():
                    self.on_feedback(message)
                news = self._of_feedback
                if news is not None and news.is_enough(message) and not decided:
                    self._is_enough = True
                    backend.traffic.interrupt(handle)
            if self._is_over():
                return Status.FAILURE
            if not decided:
                if self.on_change != "ignore" and self._is_outdated(handle, backend):
                    handle = self._follow(handle, backend)
                    continue
                self.feedback_message = self._in_words(handle)
                return Status.RUNNING
            if self._renews and not self._is_enough and handle.goal.end is not End.UNKNOWN:
                handle.goal.forget_message()
                handle = self._send(backend, self._result_left)
                continue
            self._let_go_of_older(handle, backend)
            record = self._judge(handle, backend)
            again = not self._is_over() and self._attempts.again(record, backend.randomness)
            self._tell(record, self._attempts.pause_left(backend.now()) if again else None)
            if self._is_over():
                return Status.FAILURE
            if not again:
                return self._finish(record)

    def terminate(self, new_status: Status) -> None:
        """Let go at once of an open goal; it is canceled and drained."""
        handle, backend = self._handle, self._backend
        if backend is None or handle is None:
            return
        if not self._is_recorded(handle):
            self._let_go_of_older(handle, backend)
            backend.traffic.interrupt(handle)
            outcome, reason = handle.goal.outcome, handle.goal.reason
            if outcome in (None, Outcome.SUCCEEDED):  # the result was not looked at
                outcome, reason = Outcome.CANCELED, reason or "interrupted by the tree"
            self.history.append(self._record(handle, outcome, reason, backend))
            self._tell(self.history[-1], None)
            self.feedback_message = f"{outcome}: {reason}"
        self._outcome = self.history[-1].outcome  # also in the pause before a retry

    def shutdown(self) -> None:
        """Cancel all live goals of the whole tree, wait for their ends, and let go of the client.

        py_trees calls this leaf by leaf, without a terminate before; users destroy the node on the
        next line. So the first leaf closes for all, under one deadline.
        """
        if self._backend is None:
            return
        traffic = self._backend.traffic
        leaves = [leaf for leaf in root_of(self).iterate() if isinstance(leaf, ActionBehaviour)]
        for leaf in leaves:
            ActionBehaviour.terminate(leaf, Status.INVALID)
        drain(traffic.host, [handle for leaf in leaves for handle in leaf.open_handles()])
        for leaf in leaves:
            leaf._let_go()  # noqa: SLF001 - of our own kind

    def open_handles(self) -> list[GoalHandle]:
        """Return the goals of this leaf that are not over, left ones and a second server's too."""
        open_there = [] if self._own is None else self._own.handles
        taken = [handle for handle in open_there if handle.owner is self]
        ours = dict.fromkeys([*self._left_behind, self._handle, *taken])
        return [handle for handle in ours if handle is not None and not handle.is_over]

    # Hooks for leaves of one action type

    hides_goal = False
    """Whether no event and no reason tells its goals."""
    tells_whole_result = False
    """Whether a result is data for a caller, and told whole, however large."""

    def names(self, result: Any) -> Mapping[str, object]:
        """Return the names for expressions over a result, with their values.

        Any values for None.
        """
        return {"result": result}

    def settles(self, result: Any) -> bool:
        """Return whether nothing the goal began still runs, by its result.

        False makes its end UNKNOWN.

        The result of an aborted goal may be lost, and None. Called under the lock of all goals.
        """
        return True

    def explain(self, outcome: Outcome, result: Any) -> str:
        """Return an addition to the reason of a goal that has not succeeded, or ""."""
        told = outcome is Outcome.ABORTED and result is not None
        return f"its result is: {shorten(result, 150)}" if told else ""

    # Internals

    def _begin(self, backend: Backend) -> GoalHandle:
        """Begin an attempt."""
        return self._send(backend, self.timeouts.result)

    def _send(self, backend: Backend, result: float | None, busy: Busy | None = None) -> GoalHandle:
        """Begin a goal, whose result is due so many seconds after its acceptance."""
        self._renews = False
        self._left_behind = self.open_handles()
        timeouts = self.timeouts
        self._handle = backend.traffic.begin(
            self._own,
            self,
            timeouts if result == timeouts.result else replace(timeouts, result=result),
            self.resources,
            busy or self.busy,
            attempt=self._attempts.attempt,
            keeps_feedback=self.on_feedback is not None or self._of_feedback is not None,
            accounts_for_all=self.settles,
        )
        return self._handle

    def _is_over(self) -> bool:
        """Return whether the user's code has ended the visit: by stop, or by shutdown."""
        return self._outcome is not None or self._backend is None

    def _is_recorded(self, handle: GoalHandle) -> bool:
        """Return whether this attempt is over and in the history."""
        history = self.history  # a new visit has a new one
        return bool(history) and history[-1].goal is handle.goal

    def _make_message(self) -> Any:
        action: Any = self.action_type
        teller = current_teller.get()
        if teller is not None:
            teller.reads_secret = False  # forget the reads of the attempt before
        try:
            data = self._sent = self._data()
            return fill(action.Goal, data, now=self._connection()[0].stamp)
        finally:
            reads = teller is not None and teller.reads_secret
            if (reads or self.hides_goal) and self._handle is not None:
                self._handle.goal.is_secret = True

    def _judge(self, handle: GoalHandle, backend: Backend) -> AttemptRecord:
        goal = handle.goal
        outcome, reason = goal.outcome, goal.reason
        assert outcome is not None
        if self._is_enough and goal.end in (End.CANCELED, End.SUCCEEDED):
            if goal.end is End.SUCCEEDED:
                self._reading.save(goal.result)
            outcome, reason = Outcome.SUCCEEDED, "its feedback was enough"
        elif outcome is Outcome.SUCCEEDED:
            if why := self._read_result(goal.result):
                outcome, reason = Outcome.UNEXPECTED_RESULT, why + goal.blamed
        elif more := self.explain(outcome, goal.result):
            reason += f"; {more}"
        return self._record(handle, outcome, reason, backend)

    def _record(
        self, handle: GoalHandle, outcome: Outcome, reason: str, backend: Backend
    ) -> AttemptRecord:
        goal, begun, ended = handle.goal, handle.begun_at.ros, backend.now().ros
        goal.forget_message()
        return AttemptRecord(handle.attempt, outcome, reason, begun, ended, goal.result, goal)

    def _tell(self, record: AttemptRecord, again_in: float | None) -> None:
        """Tell the run the verdict on an attempt."""
        if (teller := current_teller.get()) is None or not teller.is_heard:
            return
        hides = bool(record.reason) and (
            teller.reads_secret
            or (record.goal.is_secret and record.outcome is Outcome.INVALID_GOAL)
        )
        unmet: dict[str, object] = {}
        if record.outcome is Outcome.UNEXPECTED_RESULT:
            unmet = self._reading.seen(record.result)
        teller.tell(
            AttemptEnded,
            self,
            record.goal_id,
            record.attempt,
            record.outcome,
            HIDDEN if hides else record.reason,
            self.expected if unmet else "",
            {text: teller.shown(value) for text, value in unmet.items()},
            again_in,
        )

    def _finish(self, record: AttemptRecord) -> Status:
        self._outcome = record.outcome
        if self._of_failure is not None and record.outcome is not Outcome.SUCCEEDED:
            self._of_failure.save((record.result, str(record.outcome)))
        number = record.attempt
        tries = f" (attempt {number} of {self.retry.attempts})" if number > 1 else ""
        told = f": {record.reason}" if record.reason else ""
        self.feedback_message = f"{record.outcome}{tries}{told}"
        return Status.SUCCESS if record.outcome is Outcome.SUCCEEDED else Status.FAILURE

    def _read_result(self, result: Any) -> str:
        """Read the result and save its values; return the objection to it, or ""."""
        return self._reading.read(result)

    def _in_words(self, handle: GoalHandle) -> str:
        goal = handle.goal
        news = goal, goal.state, goal.feedback
        if any(map(is_not, news, self._shown[0])):  # not in each tick
            does = goal_doing(goal.state.shown, goal.server, self.attempt, self.retry.attempts)
            told = "" if goal.feedback is None else fields_in_words(goal.feedback)
            self._shown = news, str(does._replace(told=told))
        return self._shown[1]

    def _let_go(self) -> None:
        if self._backend is not None:
            self._left_behind = self.open_handles()  # a second server's share, too
            self._backend.traffic.leave(self._own)
        self._backend = self._own = None
