"""What a goal costs that just succeeds: each message enters once, and one look at the graph."""

from __future__ import annotations

import gc
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.terms import STATUS_SUCCEEDED, Command, Event, State
from bt_actions.traffic import state as traffic
from tests.machine.histories import Play
from tests.machine.production import Witness


class Steps(Witness):
    """Takes note of what is told, and of what a goal commands."""

    def __init__(self, caller: Any) -> None:
        super().__init__(caller)
        self.steps: list[tuple[Event, tuple[Command, ...]]] = []

    def told(
        self,
        handle: traffic.GoalHandle,
        event: Event,
        detail: Any,
        commands: tuple[Command, ...],
    ) -> None:
        super().told(handle, event, detail, commands)
        self.steps.append((event, commands))


def test_each_message_enters_once_the_graph_is_asked_once_and_there_is_one_goal() -> None:
    play = Play([0])
    caller, world, [leaf] = play.caller, play.world, play.caller.leaves

    def deliver() -> None:
        while world.options("deliver"):
            play.move("deliver", 0)

    for _ in range(2):  # before the first it is asked, too
        caller.host.trace = trace = Steps(caller)
        caller.looks = 0
        caller.tick(leaf)
        assert leaf.handle is not None
        goal = leaf.handle.goal
        deliver()
        world.answer(world.jobs[-1], True)
        deliver()
        world.finish(world.jobs[-1], STATUS_SUCCEEDED)
        deliver()
        looks = caller.looks
        caller.tick(leaf)
    assert trace.steps == [
        (Event.GRANTED, ()),
        (Event.SERVER_READY, (Command.SEND,)),
        (Event.ACCEPTED, (Command.ASK_RESULT,)),
        (Event.STATUS, ()),
        (Event.STATUS, ()),
        (Event.RESULT, (Command.RELEASE,)),
    ]
    # After it is sent: who has opened by then gets it, too
    assert (goal.state, looks) == (State.DONE, 1)
    assert [each for each in gc.get_objects() if isinstance(each, Goal) and each.id == goal.id] == [
        goal
    ]
