"""A run in which an event of every kind happens, with values that are hard to keep."""

from __future__ import annotations

from itertools import count
from typing import Any

from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    ClockJumped,
    Cut,
    Event,
    EventsLost,
    FeedbackCame,
    GoalChanged,
    Logged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    Paused,
    RoundBegan,
    RunBegan,
    RunEnded,
    ServerSeen,
    StopWanted,
    TickLasts,
    TreeFinished,
    VariableWritten,
)
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.unaccounted import GoalReport

RUN_ID = "00112233445566778899aabbccddeeff"
GOAL_ID = "ff" * 16
NODES = (
    Node(1, None, "Røt", "for_each", "tree.yaml:3:5"),
    Node(2, 1, "Move", "move", "tree.yaml:5:9", "/move", "Move", {"attempts": 2, "expect": "x"}),
    Node(3, 1, "Say", "log", "tree.yaml:7:9"),
)
WHERE = {"node": "/all", "domain": "7", "host": "robot7", "simulation": "--sim --speed 2"}
SOURCES = {"tree.yaml": "tree: all\n", "../robot.yaml": "actions: {}\n"}


def every_kind(rounds: int = 1) -> list[Event]:
    """Return the events of a run, in order; the middle of it happens `rounds` times."""
    numbers = count(1)
    events: list[Event] = []

    def tell(kind: Any, *fields: Any, **more: Any) -> None:
        number = next(numbers)
        at = Moment(number, 100.0 + number / 8, 1.8e9 + number / 16, number / 4)
        events.append(kind(at, *fields, **more))

    tell(ServerSeen, "/move", True)
    versions = {"bt_actions": "0.1.0"}
    inputs = {"to": float("nan"), "raw": b"\x00\xff", "large": 2**64 - 1}
    asked_by = "ab" * 16, "cd" * 16
    tell(RunBegan, RUN_ID, "all", NODES, inputs, SOURCES, versions, *asked_by, WHERE)
    for number in range(rounds):
        tell(NodeChanged, 1, Status.RUNNING, "")
        tell(RoundBegan, 1, number, rounds, {"at": float("inf")})
        tell(NodeChanged, 2, Status.RUNNING, "moves", due_in=3.5)
        tell(GoalChanged, 2, GOAL_ID, 1, "QUEUED", None, None, "", "/move")
        tell(GoalChanged, 2, GOAL_ID, 1, "SENDING", None, None, "", "/move", {"x": 1.5})
        tell(FeedbackCame, 2, GOAL_ID, {"left": 0.5, "name": "\x1b[31mred"})
        done = "DONE", Outcome.SUCCEEDED, End.SUCCEEDED, "", "/move"
        tell(GoalChanged, 2, GOAL_ID, 1, *done, result=Cut((1, 2), 99))
        judged = Outcome.UNEXPECTED_RESULT, "not so", "x", {"x": False}
        tell(AttemptEnded, 2, GOAL_ID, 1, *judged, again_in=0.5)
        tell(NodeChanged, 2, Status.FAILURE, "UNEXPECTED_RESULT: not so", by_itself=True)
        tell(VariableWritten, "x", "\ud800 \x00 •", 3)
        tell(Logged, 3, "warn", "said")
        tell(NodeChanged, 3, Status.SUCCESS, "", warning="nobody hears")
        tell(NodeChanged, 1, Status.RUNNING, "")
    tell(NodesAdded, (Node(4, 1, "New", "wait"),))
    tell(NodesRemoved, (4,))
    tell(ClockJumped, "wall", -3600.5)
    tell(TickLasts, 2, 1.1)
    tell(TickLasts, 2, 14.2, True)
    tell(Paused, True)
    tell(Paused, False)
    tell(EventsLost, 7)
    tell(StopWanted, "SIGINT", "interrupted by SIGINT")
    tell(NodeChanged, 1, Status.INVALID, "")
    report = GoalReport("Move", "/move", GOAL_ID, Outcome.CANCELED, "no answer", "{x: 1.5}")
    tell(TreeFinished, Status.INVALID, {}, "", False, (report,))
    tell(RunEnded, 3, "interrupted by SIGINT", "", ("Move on /move",), "the part lies at 1.00 m")
    return events
