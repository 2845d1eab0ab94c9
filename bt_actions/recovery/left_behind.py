"""A goal that a killed process left, and what is known of it by now. Looks for nothing itself."""

from __future__ import annotations

from dataclasses import dataclass, field

from bt_actions.goals.asking import DENIED_FOR_GOOD
from bt_actions.goals.policy import End
from bt_actions.recovery.roll_call import Answers, RollCall

GONE = "its server is gone"


@dataclass(slots=True)
class LeftBehind:
    """A goal whose orchestrator is dead. `end` is UNKNOWN until the server tells.

    Where two servers of one name were in sight it stays UNKNOWN: either may run it, and a status
    does not tell whose it is.
    """

    call: RollCall
    """The servers of its action."""
    goal_id: bytes
    pid: int
    shown: End = End.UNKNOWN
    asked_at: float = float("-inf")
    takes: float = DENIED_FOR_GOOD
    """Seconds for which it has to be denied until it will not turn up any more."""
    awaited: bool = False
    """It was sent, and no server has shown it yet; one may."""
    nothing_left: str = ""
    """Why none will, or its end is not told: it need not be awaited."""
    denials: Answers = field(default_factory=Answers)

    @property
    def end(self) -> End:
        """How it ended, as far as is known."""
        return self.shown if len(self.call.servers) <= 1 else End.UNKNOWN

    @property
    def is_over(self) -> bool:
        """Whether nobody runs it, nor will."""
        return self.end is not End.UNKNOWN or bool(self.nothing_left)

    def judge(self, *, known: bool, gone: bool) -> None:
        """See whether to await it: all that its servers run may be `known`, or they are `gone`."""
        if self.nothing_left == GONE and not gone:  # one is in sight after all
            self.awaited, self.nothing_left = True, ""
        if self.awaited and self.denials.lasted >= self.takes:
            self.awaited, self.nothing_left = False, f"denied for {self.takes:g} s"
        elif self.awaited and known and gone:
            self.awaited, self.nothing_left = False, GONE
