"""Histories of two and three servers of one name that have one goal, with the production code.

The others open while the request is on its way: so it comes to several. At the end all who live
have answered all that they were asked, and no goal may run that nobody wants, and none be UNKNOWN.
"""

from __future__ import annotations

import random
from collections.abc import Iterable

from bt_actions.goals.terms import STATUS_CANCELED, STATUS_SUCCEEDED
from tests.machine.histories import ACTIONS, History, Play
from tests.machine.judge import Judge
from tests.machine.world import CANCELING, NODES, UNANSWERED, Job, Mood

ACTION = ACTIONS[0]
MOVES = {
    "tick": 6,
    "deliver": 60,
    "answer": 14,
    "finish": 6,
    "wait": 10,
    "feedback": 3,
    "look": 2,
    "interrupt": 2,
}
FAULTS = {
    "kill": 2,
    "leave": 2,
    "crash": 1,
    "cut": 5,
    "outage": 8,
    "heal": 14,
    "lapse": 4,
    "overlook": 6,
    "notice": 10,
    "calm": 3,
    "mood": 2,
    "repeat": 2,
    "lose": 5,
}
_MOVES = tuple(kind for kind, weight in MOVES.items() for _ in range(weight))


def crowded_history(seed: int) -> History:
    """Return the history of this seed, always the same."""
    chance = random.Random(f"crowd {seed}")
    leaf = chance.randrange(100_000) * len(ACTIONS) * len(NODES)  # at the first, on the first
    bag = _MOVES
    for kind, weight in FAULTS.items():
        if chance.random() < 0.4:
            bag += (kind,) * weight
    begin = [("tick", 0), ("tick", 0), ("tick", 0)]
    moves = [(chance.choice(bag), chance.randrange(1000)) for _ in range(chance.randint(10, 60))]
    return History((leaf, chance.randrange(1000)), (*begin, *moves))


class CrowdJudge(Judge):
    """The judge, who here excuses no crowd."""

    def at_the_end(self) -> None:
        super().at_the_end()
        for job in self.caller.world.jobs:
            rule = f"what runs is asked to cancel, by whomever it runs: {job}"
            self._hold(job.unwanted or not job.live or self._handle(job).ledger.closed, rule)
        for endpoint in self.caller.endpoints:
            for handle in endpoint.goals.values():
                self._hold(handle.accounted_for, f"all have answered: {handle.goal!r}")


class CrowdPlay(Play):
    """A play of one leaf whose goals come to two servers, or to three."""

    def __init__(self, plans: Iterable[int], *, aloud: bool = False) -> None:
        leaf, self._how = plans
        self._loses = False
        super().__init__((leaf,), aloud=aloud)
        self.world.preempts = False
        self.judge = CrowdJudge()
        self.caller.judge, self.judge.caller = self.judge, self.caller
        self.caller.misfortunes.add("opens_meanwhile")
        if self._how % 2:
            self.caller.misfortunes.add("another_opens_meanwhile")

    def move(self, kind: str, number: int) -> None:
        """Make a move, if there is one of this kind."""
        self._loses |= kind == "lose"
        if kind == "wait":
            self._answer_probes()
        super().move(kind, number)

    def _answer_probes(self) -> None:
        """Who lives, and can be reached, answers a probe in time: by that a dead server is told."""
        for kind in ("probe", "probe answer"):
            for message in [each for each in self.world.air if each.kind == kind]:
                if not message.server.cut:
                    self.world.deliver(message)

    def finish(self, number: int) -> None:
        """End the play; what the leaf's goals have left is to be found."""
        del number
        self.settle(heals=self._how % 3 > 0, drains=True)

    def settle(self, *, heals: bool, drains: bool) -> None:
        """All who live come into sight, and answer; who is not asked to cancel runs on."""
        world, caller = self.world, self.caller
        self.say("the faults end;", "links heal" if heals else "what is cut off is gone")
        world.room = 10_000
        hidden = {gid for gid, _ in world.overlooked}
        world.overlooked.clear()
        for server in world.servers:
            server.mood = Mood.OBEYS
            if server.cut and heals:
                world.heal(server)
            elif server.cut or not server.alive:
                server.alive = server.cut = server.shown = False
        world.publish_status(hidden)
        world.wait(0.1)
        for _ in range(100):
            for leaf in caller.leaves:
                caller.interrupt(leaf)
            if self._loses or world.was_full:
                world.publish_status()
            for message in list(world.air):
                if message in world.air:
                    world.deliver(message)
            for job in list(world.jobs):
                self._go_on(job)
            world.wait(0.5)
        self.say("all is settled, or should be")
        if self.told is not None:
            self._show()
        self.judge.at_the_end()

    def _go_on(self, job: Job) -> None:
        if not job.server.alive:
            return
        if job.status == UNANSWERED:
            self.world.answer(job, True)
        elif job.status == CANCELING:
            self.world.finish(job, STATUS_CANCELED)
        elif job.live and job.unwanted:
            self.world.finish(job, STATUS_SUCCEEDED)
