"""A seeded storm over a server of trees: goals sent, canceled, replaced, halted; and kills.

The server of trees and the servers below are processes apart, and are killed; the servers' journals
are the judges of what the clients were told. Each goal has a number, which is in the distance that
its actions are asked for, so that a journal tells whose goal it was.
"""

from __future__ import annotations

import heapq
import itertools
import random
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport
from bt_actions_interfaces.srv import ControlTree

from bt_actions.simulation.journal import Event, Interval, live_intervals
from tests.support.processes import Host, HostFactory, Journal, Process
from tests.support.tree_client import Sent, TreeClient

R = RunTree.Result
POLICIES = ("reject", "queue", "replace", "parallel")
LEAVES = {"empty": 0, "one": 1, "two": 2, "both": 2, "hasty": 1, "leaves": 1}
"""How many goals below a tree has at most at its end."""
FAULTS = (
    "15%:abort",
    "10%:reject",
    "10%:delay_accept=0.1",
    "25%:delay_cancel=0.2",
    "5%:ignore_cancel",
    "5%:succeed_on_cancel",
)
_ACTION = """{{action: {leaf}, type: robot_control_interfaces/action/MoveRobot, server: {server},
 goal: {{distance: $distance}}, retry: 2,
 timeout: {{queue: 60 s, server: 20 s, accept: 5 s, result: 20 s, cancel: {cancel}}}}}"""
PATIENCE = 60.0
"""Seconds in which each accepted goal has its result, also where a server below was killed."""
AT_ONCE = 3
MEMORY = 0.25
"""MB that a round may add: a thread that is left, or a tree, is more."""


def write_trees(folder: Path, a: str, b: str) -> None:
    """Trees of one or two goals at the servers `a` and `b`."""

    def action(leaf: str, server: str, cancel: str = "5 s") -> str:
        return _ACTION.format(leaf=leaf, server=server, cancel=cancel).replace("\n", "")

    one, other = action("A", a), action("B", b)
    roots = {
        "one": one,
        "two": f"{{sequence: Two, children: [{one}, {other}]}}",
        "both": f"{{parallel: Both, children: [{one}, {other}]}}",
        "hasty": action("A", a, "50 ms"),
        "leaves": f"{{parallel: L, children: [{one}, {{python: tests.support.trees.LeavesLate}}]}}",
    }
    (folder / "empty.yaml").write_text("tree: empty\nroot: {success: }\n")
    for name, root in roots.items():
        inputs = "inputs: {distance: float64}"
        (folder / f"{name}.yaml").write_text(f"tree: {name}\n{inputs}\nroot: {root}\n")


def number_of(distance: float) -> int:
    """Whose goal it is: the digits behind the hundredths."""
    return round(distance * 1e7) % 100_000


@dataclass(slots=True)
class Goal:
    """A RunTree goal, and what its client was told of it."""

    number: int
    tree: str
    policy: str
    sent: Sent
    asked: set[int] = field(default_factory=lambda: {R.NONE})
    """The codes that it may end with, because somebody asked for it."""
    answered: bool = False
    accepted: bool = False
    told: float | None = None
    """When its client heard of its end, in seconds of the monotonic clock."""
    status: int = 0
    result: Any = None

    @property
    def open(self) -> bool:
        return not self.answered or (self.accepted and self.told is None)

    def wrong(self) -> Iterator[str]:
        """What is wrong with what was told."""
        code, settled, actions = self.result.error_code, self.result.settled, self.result.actions
        wanted = GoalStatus.STATUS_ABORTED
        if settled and code in (R.NONE, R.CANCELED):
            names = {R.NONE: "SUCCEEDED", R.CANCELED: "CANCELED"}
            wanted = getattr(GoalStatus, f"STATUS_{names[code]}")
        if self.status != wanted:
            yield f"status {self.status} with code {code}, settled {settled}"
        if settled and any(each.end == ActionReport.END_UNKNOWN for each in actions):
            yield "settled, with an action whose end is unknown"
        if not settled and "may still be running" not in self.result.error_msg:
            yield "not settled, and nobody is named"
        failed = code == R.TREE_FAILED or code > R.ACTION_FAILED
        if code == R.EXCEPTION and self.tree == "leaves":
            return
        if code not in self.asked and not failed and not (code == R.UNKNOWN and not settled):
            yield f"code {code}, which nobody asked for: {self.result.error_msg}"


@dataclass(frozen=True, slots=True)
class Held:
    """What a process holds."""

    threads: int
    files: int
    memory: float
    """MB."""

    @classmethod
    def by(cls, pid: int) -> Held:
        status = Path(f"/proc/{pid}/status").read_text()
        kilobytes = int(status.partition("VmRSS:")[2].split()[0])
        threads = int(status.partition("Threads:")[2].split()[0])
        return cls(threads, sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir()), kilobytes / 1024.0)

    def grown(self, since: Held, rounds: int) -> list[str]:
        """What has grown by more than half of a thing a round, or by too much memory."""
        found = []
        for what in ("threads", "files"):
            more = getattr(self, what) - getattr(since, what)
            if more > rounds / 2:
                found.append(f"{more} more {what} in {rounds} rounds")
        if self.memory - since.memory > MEMORY * rounds:
            found.append(f"{self.memory - since.memory:.1f} MB more in {rounds} rounds")
        return found


class Storm:
    """Rounds against one server of trees after the other, and what is wrong with them.

    Args:
        start: starts the server of trees with a policy, and waits until it is ready.
        new_client: a client of it that has seen nothing before.
        new_host: starts a process of servers.
        names: of the two servers below.
    """

    def __init__(
        self,
        seed: int,
        start: Callable[[str], Process],
        new_client: Callable[[], TreeClient],
        new_host: HostFactory,
        names: tuple[str, str],
    ) -> None:
        self.random = random.Random(seed)
        self.wrong: list[str] = []
        self.goals: list[Goal] = []
        self.held: list[tuple[int, Held, Held]] = []
        self.acts: Counter[str] = Counter()
        self.kills: Counter[str] = Counter()
        self._start, self._new_client, self._new_host = start, new_client, new_host
        self._policies = itertools.cycle(self.random.sample(POLICIES, len(POLICIES)))
        self._numbers = itertools.count(1)
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._ties = itertools.count()
        self._hosts: dict[str, Host] = {}
        self.journals: dict[str, Journal] = {}
        for name in names:
            self._open(name)

    # The rounds

    def run(self, rounds: int, kills: int) -> None:
        """So many rounds, with so many kills between."""
        each = rounds // (kills + 1)
        victims = ["serve", *self._hosts] * kills
        self._begin()
        for victim in [*self.random.sample(victims, kills), None]:
            self._rounds(each // 3)
            self._quiet()
            before = Held.by(self._server.pid)
            self._rounds(each - each // 3)
            self._quiet()
            self.held.append((each - each // 3, before, Held.by(self._server.pid)))
            if victim is not None:
                self._kill(victim)
        self._end()

    def _begin(self) -> None:
        self._policy = next(self._policies)
        self._server = self._start(self._policy)
        self._client = self._new_client()
        self._life: list[Goal] = []
        self._round("empty")  # by then the two have found each other
        self._quiet()

    def _rounds(self, number: int) -> None:
        for _ in range(number):
            self._round(self.random.choice([*LEAVES, "two", "both", "hasty", "hasty"]))

    def _round(self, tree: str) -> None:
        goal = self._send(tree)
        act = self.random.choice(["run", "cancel", "cancel", "halt", "again", "again"])
        self.acts[act] += 1
        if act in ("cancel", "halt"):
            self._later(lambda: self._ask(goal, act))
        elif act == "again":
            self._send(tree)
        self._spin_until(lambda: sum(each.open for each in self._life) < AT_ONCE)

    def _send(self, tree: str) -> Goal:
        number = next(self._numbers)
        distance = self.random.randint(5, 30) / 100 + number / 1e7
        inputs = "" if tree == "empty" else f"{{distance: {distance!r}}}"
        goal = Goal(number, tree, self._policy, self._client.begin(tree, inputs, str(number)))
        if self._policy == "replace":
            goal.asked.add(R.REPLACED)
        goal.sent.request.add_done_callback(lambda future: self._answered(goal, future))
        self._life.append(goal)
        return goal

    def _answered(self, goal: Goal, future: Any) -> None:
        goal.sent.handle = future.result()
        goal.answered, goal.accepted = True, goal.sent.accepted
        if goal.accepted:
            ended = goal.sent.handle.get_result_async()
            ended.add_done_callback(lambda future: self._told(goal, future))

    def _told(self, goal: Goal, future: Any) -> None:
        goal.told = time.monotonic()
        goal.status, goal.result = future.result().status, future.result().result

    def _ask(self, goal: Goal, act: str) -> None:
        if not goal.answered:
            self._later(lambda: self._ask(goal, act))
        elif goal.accepted and act == "cancel":
            goal.asked.add(R.CANCELED)
            goal.sent.handle.cancel_goal_async()
        elif goal.accepted:
            goal.asked.add(R.HALTED)
            halt = ControlTree.Request.HALT
            ours = goal.sent.handle.goal_id
            self._client.begin_call(ControlTree, command=halt, goal_id=ours, requested_by="storm")

    # Kills

    def _kill(self, victim: str) -> None:
        """Kill a process while goals run: the server of trees, or one below."""
        self.kills["serve" if victim == "serve" else "below"] += 1
        for _ in range(AT_ONCE):
            self._send("both")
        moment = time.monotonic() + self.random.uniform(0.0, 0.3)
        self._spin_until(lambda: time.monotonic() > moment)
        if victim == "serve":
            self._server.popen.kill()
            self._server.wait()
            self._leave()
            self._begin()
            return
        host = self._hosts[victim]
        self.journals[victim].killed[host.pid] = host.kill()
        self._open(victim)

    def _open(self, name: str) -> None:
        self._hosts[name] = self._new_host()
        journal = self._hosts[name].open(name, *FAULTS, step_period=0.02)
        self.journals.setdefault(name, journal)

    def _leave(self) -> None:
        self._client.close()
        self._due.clear()
        self.goals += self._life
        codes = {each.code for each in self._client.rejections} - {"BUSY"}
        if codes:
            self.wrong.append(f"rejected with {codes}")

    def _end(self) -> None:
        self._server.popen.terminate()
        code = self._server.wait()
        unsettled = any(each.result and not each.result.settled for each in self._life)
        if code != (3 if unsettled else 0):
            self.wrong.append(f"exit code {code}, unsettled {unsettled}: {self._server}")
        self._leave()

    # Time

    def _later(self, act: Callable[[], None]) -> None:
        due = time.monotonic() + self.random.uniform(0.0, 0.3)
        heapq.heappush(self._due, (due, next(self._ties), act))

    def _quiet(self) -> None:
        """Wait until each goal that was accepted has its result."""
        self._spin_until(lambda: not self._due and not any(each.open for each in self._life))

    def _spin_until(self, condition: Callable[[], bool]) -> None:
        def act() -> bool:
            while self._due and self._due[0][0] <= time.monotonic():
                heapq.heappop(self._due)[2]()
            return condition()

        try:
            self._client.until(act, within=PATIENCE)
        except AssertionError:
            left = [each for each in self._life if each.open]
            raise AssertionError(f"no answer for {left}; {self._server}") from None

    # Judgement

    def judge(self) -> list[str]:
        """Everything that is wrong, by what the clients were told and what the journals say."""
        found = [*self.wrong, *(w for rounds, a, b in self.held for w in b.grown(a, rounds))]
        below: dict[int, list[Interval]] = {}
        for journal in self.journals.values():
            found += [f"executed twice: {each}" for each in journal.executed_twice]
            entries = journal.entries()
            whose = {
                each.goal: number_of(each.more["distance"])
                for each in entries
                if each.event is Event.RECEIVED
            }
            for interval in live_intervals(entries, killed=journal.killed):
                below.setdefault(whose[interval.goal], []).append(interval)
        for goal in self.goals:
            if goal.told is None:
                continue
            intervals = below.get(goal.number, [])
            wrong = list(goal.wrong())
            if goal.result.settled:
                wrong += [
                    f"live after the end that was told at {goal.told}: {each}"
                    for each in intervals
                    if each.end is None or each.end > goal.told
                ]
            if goal.result.error_code == R.NONE:
                done = sum(each.how is Event.SUCCEEDED for each in intervals)
                if done != LEAVES[goal.tree]:
                    wrong.append(f"SUCCEEDED with {done} goals that did: {intervals}")
            found += [f"goal {goal.number}, {goal.tree}, {goal.policy}: {each}" for each in wrong]
        return found

    def __str__(self) -> str:
        codes = Counter(
            (each.result.error_code, "settled" if each.result.settled else "not settled")
            for each in self.goals
            if each.result
        )
        told = sum(codes.values())
        accepted = sum(each.accepted for each in self.goals)
        return (
            f"{len(self.goals)} goals, {accepted} accepted, {told} told: {dict(codes)}; acts "
            f"{dict(self.acts)}; kills {dict(self.kills)}; held {self.held}"
        )
