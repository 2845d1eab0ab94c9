"""Histories: made from a seed, played in a model world, shrunk, and told in words.

A history is a list of numbers: the plans, and then moves (what kind, and which of the choices there
are). A move that cannot be made is skipped, so every part of a history is a history.
"""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bt_actions.goals.policy import RETRYABLE, Busy, Retry, Timeouts
from bt_actions.goals.terms import STATUS_CANCELED, STATUS_SUCCEEDED
from tests.machine.judge import Judge, Violation
from tests.machine.parts import LeafPlan
from tests.machine.production import Caller
from tests.machine.world import CANCELING, NODES, UNANSWERED, Mood, World

ACTIONS = ("move", "lift")
TIMEOUTS = (
    Timeouts(queue=4.0, server=2.0, accept=1.0, result=5.0, feedback=1.0, cancel=1.5),
    Timeouts(queue=None, server=2.0, accept=1.0, result=3.0, cancel=1.5),
    Timeouts(queue=4.0, server=None, accept=1.0, feedback=1.0, cancel=None),
    Timeouts(queue=4.0, server=2.0, accept=None, result=3.0, cancel=1.5),
    Timeouts(queue=4.0, server=2.0, accept=None, cancel=None),
    Timeouts(),
)
RETRIES = (
    Retry(),
    Retry(3),
    Retry(3, outcomes=RETRYABLE),
    Retry(2, backoff=0.5, jitter=0.5, outcomes=RETRYABLE),
)
BUSY = (Busy.WAIT, Busy.WAIT, Busy.WAIT, Busy.REPLACE, Busy.REPLACE, Busy.FAIL, Busy.SHARE)
RESOURCES = (
    frozenset[str](),
    frozenset({"base"}),
    frozenset({"base"}),
    frozenset({"base", "arm"}),
)
USUAL = {
    "tick": 24,
    "deliver": 90,
    "answer": 24,
    "finish": 5,
    "wait": 14,
    "feedback": 10,
    "look": 2,
}
UNUSUAL = {
    "interrupt": 4,
    "lose": 6,
    "repeat": 3,
    "expire": 2,
    "mood": 3,
    "kill": 3,
    "leave": 2,
    "crash": 4,
    "calm": 2,
    "start": 6,
    "cut": 3,
    "lapse": 4,
    "outage": 6,
    "overlook": 3,
    "notice": 4,
    "heal": 6,
    "falter": 3,
    "clock": 3,
    "misfortune": 2,
    "drained": 3,
    "rerun": 2,
}
"""Kinds of moves and how often they are made. A history has some of the unusual kinds and not the
others, which finds more than a little of everything would (swarm testing, Groce et al. 2012)."""
_USUAL = tuple(kind for kind, weight in USUAL.items() for _ in range(weight))
_UNUSUAL = {kind: (kind,) * weight for kind, weight in UNUSUAL.items()}


@dataclass(frozen=True)
class History:
    """Numbers that say all that happens."""

    plans: tuple[int, ...]
    moves: tuple[tuple[str, int], ...]


def random_history(seed: int) -> History:
    """Return the history of this seed, always the same."""
    chance = random.Random(seed)
    draw = chance.random
    plans = tuple(int(draw() * 100_000) for _ in range(int(1.5 + draw() * 2.5)))
    bag = _USUAL
    for unusual in _UNUSUAL.values():
        if draw() < 0.5:
            bag += unusual
    size = len(bag)
    count = 15 + int(draw() * 60)
    moves = [(bag[int(draw() * size)], int(draw() * 1000)) for _ in range(count)]
    return History(plans, tuple(moves))


def plan(number: int) -> LeafPlan:
    """Return the way to make a leaf that this number stands for."""
    number, action = divmod(number, len(ACTIONS))
    number, node = divmod(number, len(NODES))
    number, timeouts = divmod(number, len(TIMEOUTS))
    number, retry = divmod(number, len(RETRIES))
    number, busy = divmod(number, len(BUSY))
    resources = number % len(RESOURCES)
    return LeafPlan(
        ACTIONS[action], TIMEOUTS[timeouts], RETRIES[retry], RESOURCES[resources], BUSY[busy], node
    )


class Play:
    """One world with its caller and its judge, and what happened so far, in words."""

    def __init__(self, plans: Iterable[int], *, aloud: bool = False) -> None:
        self.world, self.judge = World(ACTIONS), Judge()
        numbers = list(plans)
        self.world.preempts = sum(numbers) % 2 == 0
        self.caller = Caller(self.world, [plan(number) for number in numbers], self.judge)
        self.told: list[str] | None = [] if aloud else None
        self._last: dict[str, str] = {}
        for leaf in self.caller.leaves:
            self.say(leaf, leaf.plan)
        for action in ACTIONS:
            self.world.start(action)

    def say(self, *what: object) -> None:
        """Write down what happens, where somebody listens."""
        if self.told is not None:
            self.told.append(" ".join(str(part) for part in what))

    def move(self, kind: str, number: int) -> None:
        """Make a move, if there is one of this kind."""
        choices = self.world.options(kind)
        if choices:
            choice = choices[number % len(choices)]
            if self.told is not None:
                self.say(f"{self.world.now.steady - 100:6.2f} s", kind, choice)
            self.world.make(kind, choice)
            self.judge.insist()
            if self.told is not None:
                self._show()

    def _show(self) -> None:
        for handle in self.caller.handles:
            shown = f"         {handle}: {handle.goal!r} {handle.goal.reason}"
            if self._last.get(handle.name) != shown:
                self._last[handle.name] = shown
                self.say(shown)

    def finish(self, number: int) -> None:
        """End the play in one of the ways there are."""
        number //= 7
        if number % 16 == 0:
            self.caller.close()
        self.settle(heals=number % 4 < 3, drains=number % 2 == 0)

    def settle(self, *, heals: bool, drains: bool) -> None:
        """Let the faults end and every server answer; then compare report and truth."""
        world, caller = self.world, self.caller
        for action in ACTIONS:
            for node in NODES:
                caller.come(action, node)  # what was left there is only remembered until then
        self.say("the faults end;", "links heal" if heals else "what is cut off is gone")
        world.set_clock("runs")
        world.room = 10_000
        world.overlooked.clear()
        for server in world.servers:
            server.mood, server.matched = Mood.OBEYS, True
            if server.cut and heals:
                world.heal(server)
            elif server.cut:
                server.alive = server.cut = server.shown = False
            elif not server.alive:
                server.shown = False
        for action in ACTIONS:
            for second in [s for s in world.servers if s.alive and s.action == action][1:]:
                second.alive = second.shown = False
        world.wait(0.1)
        for round_ in range(60):
            if drains or round_ == 20:
                for leaf in caller.leaves:
                    caller.interrupt(leaf)
            world.publish_status()
            for message in list(world.air):
                if message in world.air:
                    world.deliver(message)
            is_over = all(leaf.attempts is None for leaf in caller.leaves) and not world.air
            if is_over and self.judge.settled():
                break
            for job in list(world.jobs):
                if job.status == UNANSWERED and job.server.alive:
                    world.answer(job, True)
                elif job.status == CANCELING and job.live:
                    world.finish(job, STATUS_CANCELED)
                elif job.live and round_ > 10:
                    world.finish(job, STATUS_SUCCEEDED)
            for leaf in caller.leaves:
                if leaf.attempts is not None:
                    caller.tick(leaf)
            world.wait(0.5)
        self.say("all is settled, or should be")
        if self.told is not None:
            self._show()
        self.judge.at_the_end()


def play(history: History, kind: type[Play] = Play, *, aloud: bool = False) -> Play:
    """Play a history to its end; raises Violation, or whatever the code under test raises."""
    played = kind(history.plans, aloud=aloud)
    try:
        for move, number in history.moves:
            played.move(move, number)
        played.finish(history.plans[0])
    except Exception as error:
        if played.told is not None:
            error.add_note("\n".join(played.told))
        raise
    return played


def broken(history: History, kind: type[Play] = Play) -> str | None:
    """Return what goes wrong in a history, or None."""
    try:
        play(history, kind)
    except Violation as violation:
        return str(violation)
    except Exception as error:  # noqa: BLE001 - any exception out of the machine is a finding
        return repr(error)
    return None


def shrink(history: History, kind: type[Play] = Play) -> History:
    """Return a shorter history that still goes wrong."""
    moves = list(history.moves)
    size = len(moves)
    while size:
        start = 0
        while start < len(moves):
            shorter = moves[:start] + moves[start + size :]
            if broken(History(history.plans, tuple(shorter)), kind) is not None:
                moves = shorter
            else:
                start += size
        size //= 2
    return History(history.plans, tuple(moves))


def tell(history: History, kind: type[Play] = Play) -> str:
    """Return a history in words, with what goes wrong at its end."""
    try:
        done = play(history, kind, aloud=True)
    except Exception as error:
        with contextlib.suppress(AttributeError):
            return "\n".join([*error.__notes__, f"BROKEN: {error!r}"])
        raise
    return "\n".join([*(done.told or ()), "nothing goes wrong"])


def first_broken(
    seeds: Iterable[int],
    kind: type[Play] = Play,
    made: Callable[[int], History] = random_history,
) -> int | None:
    """Return the first seed whose history goes wrong, or None."""
    for seed in seeds:
        if broken(made(seed), kind) is not None:
            return seed
    return None
