"""What a goal costs that just succeeds: each message enters once, two looks at the graph."""

from __future__ import annotations

import gc
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.terms import STATUS_SUCCEEDED, Command, Event, State
from bt_actions.traffic import handle as traffic
from bt_actions.traffic.effects import Do, Effect
from tests.machine.histories import Play
from tests.machine.production import Witness


class Steps(Witness):
    """Takes note of what is told, and of what is done."""

    def __init__(self, caller: Any) -> None:
        super().__init__(caller)
        self.steps: list[tuple[Event, list[Do | Command]]] = []

    def told(
        self,
        handle: traffic.GoalHandle,
        event: Event,
        detail: Any,
        commands: tuple[Command, ...],
    ) -> None:
        super().told(handle, event, detail, commands)
        self.steps.append((event, []))

    def does(self, effect: Effect) -> None:
        self.steps[-1][1].append(effect.do)


def test_each_message_enters_once_the_graph_is_asked_twice_and_there_is_one_goal() -> None:
    play = Play([0])
    caller, world, [leaf] = play.caller, play.world, play.caller.leaves
    caller.host.trace = trace = Steps(caller)

    def deliver() -> None:
        while world.options("deliver"):
            play.move("deliver", 0)

    caller.tick(leaf)
    assert leaf.handle is not None
    goal = leaf.handle.goal
    deliver()
    world.answer(world.jobs[0], True)
    deliver()
    world.finish(world.jobs[0], STATUS_SUCCEEDED)
    deliver()
    assert trace.steps == [
        (Event.GRANTED, [Do.NOTE]),
        (Event.SERVER_READY, [Do.NOTE, Do.WAKE_WAITING, Command.SEND]),
        (Event.ACCEPTED, [Do.NOTE, Do.WAKE_WAITING, Command.ASK_RESULT, Do.STRIKE]),
        (Event.STATUS, []),
        (Event.STATUS, []),
        (Event.RESULT, [Do.NOTE, Do.WAKE_WAITING, Command.RELEASE, Do.RETIRE]),
    ]
    # Before it is sent, and after: who opens in between gets it, too
    assert (goal.state, caller.looks) == (State.DONE, 2)
    assert [each for each in gc.get_objects() if isinstance(each, Goal) and each.id == goal.id] == [
        goal
    ]
