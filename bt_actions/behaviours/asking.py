"""Common parts of nodes that hold others: questions that may fail, rounds, goals that still end."""

from __future__ import annotations

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.connected import Timed
from bt_actions.events.kinds import RoundBegan
from bt_actions.events.snapshot import HIDDEN, snapshot
from bt_actions.events.teller import current_teller
from bt_actions.goals.policy import Retry
from bt_actions.utilities.shorten import shorten

Number = Callable[[], object] | int | None


class Asking(Timed):
    """A node whose questions fail the visit where they raise ValueError, with its text."""

    reads_secret = False
    """Whether the node has read a secret in this visit, so that no event tells its message."""
    refused = False
    """Whether the node failed by itself: its child did not fail, or was not ticked this time."""
    left_out = False
    """Whether the parent goes on as if the ended node were not there."""

    def _begin_visit(self) -> None:
        """Begin a visit."""
        self.feedback_message, self.reads_secret, self.left_out = "", False, False
        self._seconds = 0.0  # unless `give` sets a time
        self.initialise()

    def _answer(self, question: Callable[[], Status | None]) -> Status | None:
        try:
            return question()
        except ValueError as error:
            self.feedback_message, self.refused = str(error), True
            return Status.FAILURE
        finally:
            if (teller := current_teller.get()) is not None and teller.has_news:
                self.reads_secret |= teller.reads_secret
                teller.claim(self)


class Rounds(Asking):
    """A node whose rounds are counted and told; `_times` says how many at most."""

    _again, _counts, _least = Status.SUCCESS, "times", 0
    _pauses = Retry()
    _times: Number

    def initialise(self) -> None:
        self._done, self._of, self._told = 0, "", -1
        self._limit: int | None = None
        if self._times is None:
            return
        try:
            limit = self._times() if callable(self._times) else self._times
        except ValueError as error:
            raise ValueError(f"{self._counts}: {error}") from error
        if isinstance(limit, bool) or not isinstance(limit, int) or limit < self._least:
            wanted = f"a whole number of at least {self._least} is needed"
            raise ValueError(f"{self._counts}: {wanted}, not {shorten(limit, 60)}")
        self._limit, self._of = limit, f" of {limit}"

    @property
    def item(self) -> object:
        """The item of the present round; None where rounds have only a number."""
        return None

    def tell_round(self) -> None:
        """Tell, once, that a round begins."""
        if self._told == self._done:
            return
        self._told = self._done
        if (teller := current_teller.get()) is not None and teller.is_heard:
            self.reads_secret |= teller.reads_secret
            hides = self.reads_secret
            item = HIDDEN if hides and self.item is not None else snapshot(self.item)
            teller.tell(RoundBegan, self, self._done, None if hides else self._limit, item)

    def count(self) -> Status:
        """Count a round that is done; return the status that follows."""
        self._done += 1
        self.feedback_message = f"{self._done}{self._of} done"
        if self._done == self._limit:
            return self._again
        self.give(self._pauses.pause(self._done))
        return Status.RUNNING


class Tries(Rounds):
    """A node whose rounds are attempts: another one follows a failure."""

    _again, _counts, _least = Status.FAILURE, "attempts", 1

    def count(self) -> Status:
        status = super().count()
        self.feedback_message = f"attempt {self._done}{self._of} failed"
        return status

    def tell_success(self) -> None:
        """Name the attempt that has succeeded, if not the first."""
        if self._done:
            self.feedback_message = f"attempt {self._done + 1}{self._of} succeeded"


def actions_below(root: Behaviour) -> list[ActionBehaviour]:
    """Return the leaves of actions at or below a node."""
    return [node for node in root.iterate() if isinstance(node, ActionBehaviour)]


def still_ends(root: Behaviour) -> str:
    """Name a leaf below a stopped node whose goal has yet to end; or ""."""
    leaves = (node.name for node in actions_below(root) if node.draining)
    return next((f"waiting for {name} to end" for name in leaves), "")
