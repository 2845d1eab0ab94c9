"""The goals of a tree's runs: membership, their changes as events, and the unaccounted ones.

A goal belongs to the tree that ticked its leaf last, even if a program has moved the leaf since. A
change becomes an event on the thread where the change happens. No function here sends a message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from bt_actions.events import FeedbackCame, GoalChanged, ServerSeen
from bt_actions.events.snapshot import HIDDEN, snapshot
from bt_actions.events.teller import OFTEN, Teller, current_teller
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.terms import State
from bt_actions.goals.unaccounted import GoalReport, report_of
from bt_actions.traffic.state import GoalHandle, Host, RunListener, ticking_run

T = TypeVar("T")


class RunGoals:
    """The goals of one tree, until each is over."""

    def __init__(
        self,
        teller: Teller,
        host: Host,
        *,
        wake: Callable[[], None],
        on_change: Callable[[], None],
    ) -> None:
        """Make the register; `wake` is called where the tree has reason to tick.

        `on_change` is called, under the host's lock, where a goal of the tree has changed.
        """
        self._teller, self._wake, self._on_change = teller, wake, on_change
        self._lock, self._steady = host.lock, host.steady
        self._run = RunListener(notify=self._note, feedback=self._feedback, sight=self._sight)
        self._handles: dict[GoalHandle, _Told] = {}  # in the order in which they began
        self._late: dict[GoalHandle, None] = {}
        """Goals with feedback that was not told yet."""
        self.run_goes_on = False
        """Whether a run goes on; between two runs only goals of earlier ones are of interest."""
        self.is_watched = True
        """Whether an object besides the leaf acts on a goal's changes."""

    def begun_in(self, step: Callable[[], T]) -> T:
        """Return the result of `step`; behaviours that it sets up and ticks are this tree's."""
        before, teller = ticking_run.set(self._run), current_teller.set(self._teller)
        try:
            return step()
        finally:
            current_teller.reset(teller)
            ticking_run.reset(before)

    @property
    def not_over(self) -> list[GoalHandle]:
        """The goals with something left to wait for."""
        return [handle for handle in list(self._handles) if not handle.is_over]

    @property
    def wanted(self) -> list[GoalHandle]:
        """The goals that a leaf waits for."""
        return [handle for handle in list(self._handles) if handle.goal.outcome is None]

    @property
    def unaccounted(self) -> list[GoalReport]:
        """The goals whose end is UNKNOWN, by now."""
        return [
            report_of(handle.goal, handle.name)
            for handle in list(self._handles)
            if handle.goal.end is End.UNKNOWN
            and (handle.goal.outcome is not None or not self.run_goes_on)
        ]

    def close(self) -> None:
        """Stop to take note of goals."""
        self._run.notify = lambda handle: None
        self._run.feedback = lambda handle, message: None
        self._run.sight = lambda server, in_sight: None

    def tell_feedback(self) -> None:
        """Tell feedback that came too soon after the one before; the caller holds the lock."""
        now = self._steady()
        for handle in [each for each in self._late if now - self._handles[each].at >= OFTEN]:
            self._handles[handle].at = now
            self._tell_feedback(handle, self._handles[handle])

    def forget(self) -> None:
        """Forget goals that are over."""
        if over := [each for each in list(self._handles) if each.is_over]:
            with self._lock:
                for each in over:
                    del self._handles[each]
                    self._late.pop(each, None)

    # Under the lock of the traffic, on any thread

    def _note(self, handle: GoalHandle | None) -> None:
        if handle is not None:
            goal = handle.goal
            told = self._handles.get(handle)
            is_news = told is not None  # else the leaf is just beginning the goal
            if told is None:
                told = self._handles[handle] = _Told(self._teller.run_id)
            is_of_this_run = told.run_id == self._teller.run_id
            if self._teller.is_heard and is_of_this_run:
                self._tell(handle, told)
            self._on_change()
            may_be_sent = is_news and goal.state is State.WAITING_FOR_SERVER
            if not (self.is_watched or may_be_sent or goal.outcome is not None):
                return  # its leaf would do nothing
        elif not self.run_goes_on:
            return
        self._wake()

    def _tell(self, handle: GoalHandle, told: _Told) -> None:
        goal, values = handle.goal, {}
        if goal.state is State.SENDING and goal.message is not None:
            values["goal"] = HIDDEN if goal.is_secret else snapshot(goal.message)
        if goal.result is not None and not told.result:
            told.result = True
            is_data = getattr(handle.owner, "tells_whole_result", False)  # for a caller
            whole = {"fields": 100_000, "size": 10_000_000} if is_data else {}
            values["result"] = snapshot(goal.result, **whole)
        if goal.outcome is not None:
            self._tell_feedback(handle, told)
        invalid = goal.is_secret and goal.outcome is Outcome.INVALID_GOAL
        reason = HIDDEN if invalid else goal.reason
        said = goal.state.shown, goal.outcome, goal.end, reason, goal.server
        self._teller.tell(GoalChanged, handle.owner, goal.id.hex(), handle.attempt, *said, **values)

    def _feedback(self, handle: GoalHandle, message: Any) -> None:
        told = self._handles.get(handle)
        if told is None or not self._teller.is_heard:
            return
        told.feedback = snapshot(message) if handle.keeps_feedback else message
        now = self._steady()
        self._late[handle] = None
        if now - told.at >= OFTEN:
            told.at = now
            self._tell_feedback(handle, told)

    def _sight(self, server: str, in_sight: bool) -> None:
        self._teller.stream.add(ServerSeen, server, in_sight)

    def _tell_feedback(self, handle: GoalHandle, told: _Told) -> None:
        """Tell the latest feedback that was not told yet."""
        message, told.feedback = told.feedback, None
        self._late.pop(handle, None)
        if message is not None:
            self._teller.tell(FeedbackCame, handle.owner, handle.goal.id.hex(), snapshot(message))


class _Told:
    """The told part of one goal."""

    __slots__ = ("at", "feedback", "result", "run_id")

    def __init__(self, run_id: str) -> None:
        self.run_id = run_id
        self.result = False
        self.at = float("-inf")
        """The moment of the last told feedback."""
        self.feedback: Any = None
        """The latest untold feedback; a snapshot where a leaf's `on_feedback` may change it."""
