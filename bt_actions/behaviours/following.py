"""Goals that follow their fields: the part of an action's leaf that sends another goal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bt_actions.behaviours.variables import resolve
from bt_actions.goals.policy import Busy
from bt_actions.goals.terms import State
from bt_actions.messages.conversion import fill
from bt_actions.utilities.plain_data import same

if TYPE_CHECKING:
    from bt_actions.traffic.backend import Backend
    from bt_actions.traffic.state import GoalHandle

ON_CHANGE = ("ignore", "replace", "cancel")
_PLAIN = {bool, int, float, str}


class Following:
    """The comparison, at each tick, of the sent goal with the goal that would be sent now.

    Beside the newest goal of a leaf runs one other at most, which the newest is to replace. A
    change that comes meanwhile waits, and the newest change counts.
    """

    action_type: Any
    goal: Any
    on_change: str
    open_handles: Callable[[], list[GoalHandle]]
    _send: Callable[..., GoalHandle]
    _sent: object = None
    """The data of the newest goal."""
    _renews = False
    """Whether another goal is to follow when this one, which is canceled, has ended."""
    _result_left: float | None = None
    """The seconds that the other goal then has for its result."""

    def _data(self) -> object:
        """Compute the data of a goal."""
        return resolve(self.goal() if callable(self.goal) else self.goal)

    def _is_plain(self) -> bool:
        """Return whether the goal becomes a message without code of the user's."""
        goal = self.goal
        return type(goal) is dict and all(type(each) in _PLAIN for each in goal.values())

    def _is_outdated(self, newest: GoalHandle, backend: Backend) -> bool:
        """Return whether to send another goal now in the place of one that executes.

        While an older goal has yet to end, the other goal is to follow the end of this one.
        """
        if newest.goal.state is not State.EXECUTING:
            return False
        is_outdated = self._differs()
        others = (each for each in self.open_handles() if each is not newest)
        if not any(not each.is_decided for each in others):
            return is_outdated
        self._renews = is_outdated
        if is_outdated:
            self._result_left = backend.traffic.result_due_in(newest)
        return False

    def _differs(self) -> bool:
        """Return whether the goal that would be sent now is sound, and unlike the sent one."""
        try:
            data = self._data()
            if same(data, self._sent):
                return False
            # at one moment, so that a stamp of `now` is no difference
            one, other = (
                fill(self.action_type.Goal, each, now=lambda: 0) for each in (data, self._sent)
            )
            return bool(one != other)
        except Exception:  # noqa: BLE001 - the user's: any; the sent goal runs on
            return False

    def _follow(self, newest: GoalHandle, backend: Backend) -> GoalHandle:
        """Send a goal in the place of an outdated one, or cancel that one first."""
        left = backend.traffic.result_due_in(newest)
        if self.on_change == "replace":
            return self._send(backend, left, Busy.REPLACE)
        self._renews, self._result_left = True, left
        backend.traffic.interrupt(newest)
        return newest

    def _let_go_of_older(self, newest: GoalHandle, backend: Backend) -> None:
        """Interrupt a goal that the newest one was to replace, and that still executes."""
        for handle in self.open_handles():
            if handle is not newest and handle.goal.state in (State.EXECUTING, State.REPLACED):
                backend.traffic.interrupt(handle)
