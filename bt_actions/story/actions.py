"""The story of one action leaf in a run, and of each of its goals. Folded from events.

See state.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from bt_actions.events.kinds import AttemptEnded, FeedbackCame, GoalChanged, Moment, Node
from bt_actions.events.snapshot import Value
from bt_actions.goals.policy import End, Outcome

DONE = "DONE"
UNSENT = ("QUEUED", "WAITING_FOR_SERVER")
"""The states of a goal before its request goes out."""


@dataclass(slots=True)
class GoalStory:
    """One goal: its message, its state, its outcome and its end."""

    latest: GoalChanged
    since: Moment
    """The moment at which its present state began."""
    began: Moment
    accepted: Moment | None = None
    goal: Value = None
    feedback: FeedbackCame | None = None
    result: Value = None
    verdict: AttemptEnded | None = None
    """The leaf's judgement of it."""

    @property
    def outcome(self) -> Outcome | None:
        """The outcome in the leaf's judgement, or else the goal's own."""
        return self.latest.outcome if self.verdict is None else self.verdict.outcome

    @property
    def reason(self) -> str:
        """The outcome in words."""
        told = self.verdict.reason if self.verdict is not None else ""
        return told or self.latest.reason

    @property
    def in_doubt(self) -> bool:
        """Whether the goal has not begun as far as its server knows, which may change."""
        return self.latest.end is End.NEVER_STARTED and self.latest.state != DONE

    def goal_changed(self, event: GoalChanged) -> None:
        """Fold an event of the goal."""
        if event.state != self.latest.state:
            self.since = event.at
            if event.state == "EXECUTING":
                self.accepted = event.at
        self.latest = event
        self.goal = self.goal if event.goal is None else event.goal
        self.result = self.result if event.result is None else event.result


@dataclass(slots=True)
class ActionStory:
    """The whole story of one action leaf in a run, over all its visits."""

    node: Node
    path: tuple[str, ...]
    server: str
    attempts: int = 0
    """Goals in all visits, sent or not."""
    visits: int = 0
    failed: int = 0
    """Visits that ended in FAILURE."""
    outcome: Outcome | None = None
    """The outcome of the latest attempt; None while it is under way."""
    end: End | None = None
    reason: str = ""
    begun: float = 0.0
    """The beginning of the latest visit, in seconds on the steady clock."""
    counted: float = 0.0
    """Seconds of the visits before the latest."""
    duration: float = 0.0
    """Seconds from the first wish to the last outcome of each visit, summed up."""
    goals: dict[str, GoalStory] = field(default_factory=dict)
    """The goals of the latest visit by id, and older ones that may have more events, or an
    unknown end."""
    latest: GoalStory | None = None

    @property
    def lately(self) -> float:
        """Seconds from the first wish to the last outcome of the latest visit."""
        return self.duration - self.counted

    @property
    def attempt(self) -> int:
        """The number of the latest attempt within its visit."""
        return self.latest.latest.attempt if self.latest is not None else 0

    @property
    def state(self) -> str:
        """The state of the latest goal."""
        return self.latest.latest.state if self.latest is not None else ""

    @property
    def of(self) -> int:
        """The number of attempts that a visit may have."""
        attempts = self.node.settings.get("attempts", 1)
        return attempts if isinstance(attempts, int) else 1

    @property
    def open(self) -> list[GoalChanged]:
        """The latest event of each goal that may have more."""
        changes = [goal.latest for goal in self.goals.values()]
        return [each for each in changes if each.state != DONE or each.end is End.SERVER_GONE]

    @property
    def live(self) -> dict[str, str]:
        """The goals that may be running, also those that the leaf has left: their states by id."""
        return {
            each.goal_id: each.state
            for each in self.open
            if each.state not in UNSENT and each.end in (None, End.UNKNOWN)
        }

    @property
    def given_up(self) -> list[GoalChanged]:
        """The latest event of each goal whose end will stay unknown."""
        changes = [goal.latest for goal in self.goals.values()]
        return [each for each in changes if each.state == DONE and each.end is End.UNKNOWN]

    @property
    def left_at_server(self) -> bool:
        """Whether a goal of this leaf had a server that went away, and may be back with it."""
        return any(each.end is End.SERVER_GONE for each in self.open)

    @property
    def in_doubt(self) -> bool:
        """Whether the latest goal has not begun as far as its server knows, which may change."""
        return self.latest is not None and self.latest.in_doubt

    @property
    def waited_for(self) -> int:
        """The number of this leaf's goals that an ended run waits for."""
        return len(self.live) + sum(each.end is End.NEVER_STARTED for each in self.open)

    @property
    def tried(self) -> list[GoalStory]:
        """The attempts of the latest visit."""
        begun = self.begun
        return [goal for goal in self.goals.values() if goal.began.steady >= begun]

    def goal_changed(self, event: GoalChanged) -> None:
        """Fold an event of a goal of this leaf."""
        goal = self.goals.get(event.goal_id)
        if goal is None:
            goal = self._begin(event)
        else:
            goal.goal_changed(event)
        if goal is not self.latest:
            return  # an older goal, on its way to its end
        if event.outcome is not None and self.outcome is None:
            self.duration = self.seconds(event.at.steady)
        self.outcome, self.end = goal.outcome, event.end
        self.reason = goal.reason

    def _begin(self, event: GoalChanged) -> GoalStory:
        if event.outcome is not None and self.latest is not None:  # the goal's visit is forgotten
            late = self.goals[event.goal_id] = GoalStory(event, event.at, event.at)
            return late
        if event.attempt <= 1:
            kept = {each.goal_id for each in (*self.open, *self.given_up)}
            self.goals = {key: goal for key, goal in self.goals.items() if key in kept}
            self.visits += 1
            self.begun, self.counted = event.at.steady, self.duration
        self.attempts += 1
        self.outcome = None
        self.latest = self.goals[event.goal_id] = GoalStory(
            event, event.at, event.at, goal=event.goal, result=event.result
        )
        return self.latest

    def judge(self, verdict: AttemptEnded) -> None:
        """Take over the leaf's own judgement of one goal."""
        goal = self.goals.get(verdict.goal_id)
        if goal is None:
            return
        goal.verdict = verdict
        if goal is self.latest:
            if self.outcome is None:
                self.duration = self.seconds(verdict.at.steady)
            self.outcome, self.reason = goal.outcome, goal.reason

    def leave(self, now: float) -> None:
        """Stop to wait for its goals: their ends stay unknown."""
        if self.outcome is None:
            self.duration = self.seconds(now)
            self.outcome = Outcome.CANCELED
        self.end = End.UNKNOWN

    def seconds(self, now: float) -> float:
        """Return the seconds that the leaf took so far, an unfinished visit included."""
        if self.outcome is not None:
            return self.duration
        return self.counted + max(0.0, now - self.begun)
