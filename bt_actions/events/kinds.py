"""The events of a run, as frozen values of plain data: nothing here refers to a live object.

Every event begins with its `Moment`. A node of the tree is named by its number in `RunBegan`.
Values of goals, results, feedback and variables are snapshots (snapshot.py); wire.py has their
exact form as JSON. docs/events.md tells when each kind comes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from py_trees.common import Status

from bt_actions.events.snapshot import Value
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.unaccounted import GoalReport

LEFT_OUT = "left out"
"""The beginning of the message of an ended node that was left out, whatever its status."""


def says_left_out(status: Status, message: str) -> bool:
    """Return whether a node of this status and message was left out."""
    is_over = status in (Status.SUCCESS, Status.FAILURE)
    return is_over and (message == LEFT_OUT or message.startswith(f"{LEFT_OUT}: "))


class Moment(NamedTuple):
    """The time of an event, and its place in the order of all events of a runner."""

    number: int
    """The number from 1, without a gap; by number the steady clock never goes back."""
    steady: float
    """Seconds on the steady clock."""
    wall: float
    """Seconds since 1970 on the computer's clock."""
    ros: float
    """Seconds on the ROS clock of the run's node."""


@dataclass(frozen=True, slots=True)
class Node:
    """One node of a tree, as it was when the run began or the node was inserted."""

    id: int
    """The number from 1, parents first."""
    parent: int | None
    name: str
    kind: str
    """The word of the YAML language where it has one, else the name of the class."""
    place: str = ""
    """``file:line:column`` in a tree file; "" for a node made in Python."""
    server: str = ""
    """The fully qualified name of the action; "" for a node that is no action."""
    action: str = ""
    """The short name of the action's type."""
    settings: Mapping[str, Value] = field(default_factory=dict)
    """The policies of the node: `timeouts` in seconds by phase, `attempts`, `expect`, `memory`,
    `only_if`, `only_while`,
    `constants` by message (``{"feedback": {"status": {"2": "MOVING"}}}``)."""
    index: int | None = None
    """The place of an inserted node among its siblings, from 0."""


@dataclass(frozen=True, slots=True)
class Event:
    """The common part of all kinds."""

    at: Moment


@dataclass(frozen=True, slots=True)
class RunBegan(Event):
    """A tree is set up, and about to be ticked; or its setup failed. The first event of a run."""

    run_id: str
    """32 hexadecimal digits."""
    tree: str
    nodes: tuple[Node, ...]
    inputs: Mapping[str, Value]
    sources: Mapping[str, str]
    """The tree files by path, as they were read."""
    versions: Mapping[str, str]
    """The versions of bt_actions, py_trees, rclpy and Python."""
    request: str = ""
    """The UUID of the RunTree goal that the run answers, in hexadecimal; or ""."""
    caller: str = ""
    """The `run_id` of the run whose leaf sent that goal, where it is known."""
    where: Mapping[str, str] = field(default_factory=dict)
    """`node` (its full name), `domain` and `host`; for a run in a simulation also `simulation`:
    the options for the stand-in of the world (``--sim --speed 10 --fault move_robot:1:abort``)."""


@dataclass(frozen=True, slots=True)
class NodesAdded(Event):
    """Nodes were inserted into the tree while it runs."""

    nodes: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class NodesRemoved(Event):
    """Nodes are out of the tree."""

    nodes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class NodeChanged(Event):
    """A node has another status, or has ended again: each visit is told, its RUNNING ticks once."""

    node: int
    status: Status
    message: str
    by_itself: bool = False
    """For a FAILURE: whether no failure below the node has caused it."""
    warning: str = ""
    """For a SUCCESS: why that may not be meant."""
    due_in: float | None = None
    """For RUNNING: seconds until the node's own time runs out, where it has one."""

    @property
    def is_left_out(self) -> bool:
        """Whether the node was left out: its parent goes on as if it were not there."""
        return says_left_out(self.status, self.message)

    @property
    def why_left_out(self) -> str:
        """Why the node was left out: its condition, and what stood in it; "" for its children's."""
        return self.message.removeprefix(LEFT_OUT).removeprefix(": ")


@dataclass(frozen=True, slots=True)
class TickLasts(Event):
    """The tick of a node itself has not returned for long; or, with `is_over`, has now.

    All of the tree waits for that tick. The event comes from another thread, once for each such
    tick.
    """

    node: int
    """The innermost node in whose tick the tree is; its status may be told yet."""
    seconds: float
    """The seconds of the tick by now."""
    is_over: bool = False


@dataclass(frozen=True, slots=True)
class GoalChanged(Event):
    """A goal has a new state, outcome or end; also after its leaf has left it."""

    node: int
    goal_id: str
    """The UUID in hexadecimal."""
    attempt: int
    state: str
    outcome: Outcome | None
    end: End | None
    reason: str
    server: str
    goal: Value = None
    """The goal message; with the state SENDING alone."""
    result: Value = None
    """The result message; told once."""


@dataclass(frozen=True, slots=True)
class AttemptEnded(Event):
    """A leaf has judged one attempt: `expect` may want more than the server did."""

    node: int
    goal_id: str
    attempt: int
    outcome: Outcome
    reason: str
    expect: str = ""
    """The condition that the result does not meet, as it was written; or ""."""
    seen: Mapping[str, Value] = field(default_factory=dict)
    """The value of each name and field in that condition: ``{"result.stalled": False}``."""
    again_in: float | None = None
    """Seconds until the next attempt; None without one."""


@dataclass(frozen=True, slots=True)
class FeedbackCame(Event):
    """Feedback of a goal: at most five a second of each, and always the last before its end."""

    node: int
    goal_id: str
    feedback: Value


@dataclass(frozen=True, slots=True)
class VariableWritten(Event):
    """A variable has another value: at most five a second, the last before a failure always."""

    name: str
    """The name in the tree, behind name and number of its subtree (``recover_1/x``); for a
    variable of the user's own, the blackboard's key."""
    value: Value
    node: int | None
    """The node in whose tick it was written, where that is known."""


@dataclass(frozen=True, slots=True)
class RoundBegan(Event):
    """A loop (`for_each`, `repeat`, `retry`) begins its child anew."""

    node: int
    number: int
    """The number from 0."""
    of: int | None
    """The number of rounds at most; None without a limit."""
    item: Value = None
    """The item of a `for_each`."""


@dataclass(frozen=True, slots=True)
class ServerSeen(Event):
    """An action server has come in sight of the run, or has gone out of it."""

    server: str
    in_sight: bool


@dataclass(frozen=True, slots=True)
class Logged(Event):
    """A `log:` node of the tree says something."""

    node: int
    level: str
    """debug, info, warn, error or fatal."""
    text: str


@dataclass(frozen=True, slots=True)
class ClockJumped(Event):
    """The wall clock was set, or the ROS clock went back."""

    clock: str
    """The clock: wall or ros."""
    seconds: float


@dataclass(frozen=True, slots=True)
class Paused(Event):
    """The run is paused, and begins no new goal; or it goes on."""

    paused: bool


@dataclass(frozen=True, slots=True)
class StopWanted(Event):
    """A request to end the run: its goals are canceled and drained."""

    who: str
    """The author: SIGINT and the like, TIMEOUT, SIGPIPE, INTERRUPTED (by a program); for a
    served run CANCELED, HALTED, ..."""
    why: str
    """The reason, to follow the status: ``interrupted by SIGINT``."""
    abandons: bool = False
    """Whether goals that are being drained are waited for no longer."""


@dataclass(frozen=True, slots=True)
class TreeFinished(Event):
    """The tree has a status of its own, or was stopped (INVALID); its goals are drained."""

    status: Status
    outputs: Mapping[str, Value] = field(default_factory=dict)
    """The outputs of a success, whole: they are data for the caller."""
    error: str = ""
    """The error of a behaviour, with its place; or ""."""
    unusable: bool = False
    """Whether the tree cannot be set up as it is given, whatever the world does."""
    unaccounted: tuple[GoalReport, ...] = ()
    culprit: int | None = None
    """The node that raised it."""


@dataclass(frozen=True, slots=True)
class RunEnded(Event):
    """The run is over for its caller: the last event."""

    exit_code: int
    cause: str = ""
    """The reason why the run did not end by itself, or ""."""
    error: str = ""
    """The reason why the caller's wish could not be met at all, or ""."""
    unaccounted: tuple[str, ...] = ()
    """A line for each goal whose end is not known, left ones included."""
    world: str = ""
    """The state of the simulated world, or ""."""
    complaint: str = ""
    """A difference of that world from what was expected, or ""."""


@dataclass(frozen=True, slots=True)
class EventsLost(Event):
    """The reader was too slow: so many events were left out before this one."""

    count: int


Observer: TypeAlias = Callable[[Event], None]
"""Called on the ticking thread with each event, in their order; an observer that raises is
removed, and the run goes on."""
