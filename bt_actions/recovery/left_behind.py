"""A goal that a killed process left, and what is known of it by now. Looks for nothing itself."""

from __future__ import annotations

from dataclasses import dataclass, field

from bt_actions.goals.asking import DENIED_FOR_GOOD
from bt_actions.goals.policy import End
from bt_actions.recovery.roll_call import Denial


@dataclass(slots=True)
class LeftBehind:
    """A goal whose orchestrator is dead. `end` is UNKNOWN until the server tells.

    Where `servers` of one name were in sight, and not one, it stays UNKNOWN: either may run it, and
    a status does not tell whose it is.
    """

    action: str
    goal_id: bytes
    pid: int
    shown: End = End.UNKNOWN
    servers: int = 1
    asked_at: float = float("-inf")
    takes: float = DENIED_FOR_GOOD
    """Seconds for which it has to be denied until it will not turn up any more."""
    awaited: bool = False
    """It was sent, and no server has shown it yet; one may."""
    nothing_left: str = ""
    """Why none will, or its end is not told: it need not be awaited."""
    server_is_gone: bool = False
    """That is why."""
    denial: Denial = field(default_factory=Denial)

    @property
    def end(self) -> End:
        """How it ended, as far as is known."""
        return self.shown if self.servers <= 1 else End.UNKNOWN

    @property
    def is_over(self) -> bool:
        """Whether nobody runs it, nor will."""
        return self.end is not End.UNKNOWN or bool(self.nothing_left)

    def is_nowhere(self, why: str) -> None:
        """No server has it, nor will."""
        self.awaited, self.nothing_left = False, why

    def turns_up(self) -> None:
        """A server has it: it tells the end in a status."""
        self.awaited, self.nothing_left, self.server_is_gone = False, "", False
        self.asked_at = float("-inf")

    def is_awaited_again(self) -> None:
        """A server that may have it is in sight after all."""
        self.awaited, self.nothing_left, self.server_is_gone = True, "", False
        self.denial.begin()
