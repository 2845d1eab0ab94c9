"""The world of a case, in virtual time: a server for each action, a topic for each condition.

Messages take no time, and what a leaf sends is answered before the leaf looks again: the network
delivers whenever nobody holds the lock of the goals, as a receiving thread might that never waits.
So a goal that takes no time has ended in the tick in which it was sent, and one that is canceled
has ended before the next node is ticked.

A tick of the world is one tick of the tree, while time stands still, and another one at once as
long as a loop is about to begin its next round; in single ticks, a loop whose child ran before. A
runner would tick on while a status changes, and so ask again, at times of its own, what a reactive
composite asks at each tick.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

from py_trees.common import Status
from py_trees.trees import BehaviourTree
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Bool

from bt_actions import load_tree
from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.composites import InTurn
from bt_actions.behaviours.decorators import Repeat
from bt_actions.document.findings import LOADED
from bt_actions.goals.terms import STATUS_ABORTED, STATUS_CANCELED, STATUS_SUCCEEDED
from bt_actions.running.loop import TickLoop
from bt_actions.simulation.platform import Request
from bt_actions.testing import VirtualBackend, VirtualNetwork
from bt_actions.testing.host import VirtualHost
from bt_actions.utilities.stepping import Done
from tests.support.oracle.cases import Case, Tick
from tests.support.oracle.importing import values_of, write

ROUND_A_TICK = "KeepRunningUntilFailure", "LoopInt"
"""The loops whose next round waits for the next tick of the world; nodes are named by their tag."""
STATUSES = {"S": STATUS_SUCCEEDED, "F": STATUS_ABORTED, "x": STATUS_CANCELED}
"""What the server of a goal says of its end."""


class Network(VirtualNetwork):
    """A network on which messages take no time."""

    def soon(self, work: Callable[..., object], *arguments: Any) -> None:
        self.timeline.call_in(0.0, partial(work, *arguments))

    def settle(self) -> None:
        """Let all happen that is due at this moment."""
        while self.timeline.advance(self.timeline.now):
            pass


class PromptLock(nullcontext[None]):
    """The lock of the goals: whoever lets go of it lets all arrive that was sent."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self._network, self._held = network, 0

    def __enter__(self) -> None:
        self._held += 1

    def __exit__(self, *error: object) -> None:
        if self._held == 1:
            self._network.settle()  # which takes it, too, and does not come here
        self._held -= 1


class PromptHost(VirtualHost):
    """A process whose receiving thread never waits."""

    def __init__(self, network: Network) -> None:
        super().__init__(network.timeline, network.log)
        self.lock = PromptLock(network)


class Server:
    """The server of one action: its goals end as the case says. It tells the world what it saw."""

    def __init__(self, world: World, name: str) -> None:
        self._world, self._name = world, name
        self._script = world.case.acts[name]
        self._begun = 0
        self.live: dict[str, tuple[int, str]] = {}
        """The tick of the world from which on a goal has ended, and how."""
        self._wire = world.network.serve(MoveRobot, name, self, result_timeout=1000.0)

    def before(self, update: Callable[[], Status]) -> Callable[[], Status]:
        """Have goals end when their leaf is ticked: one that is stopped first has not ended."""

        def ending() -> Status:
            self._end_what_is_due()
            self._world.network.settle()
            return update()

        return ending

    def on_request(self, request: Request) -> bool:
        return True

    def decide(self, goal: Any) -> bool:
        return True

    def start(self, goal_id: str, goal: Any) -> None:
        ticks, end = self._script[min(self._begun, len(self._script) - 1)]
        self._begun += 1
        self._world.saw.append(f"{self._name}+")
        self._wire.start(goal_id)
        self.live[goal_id] = self._world.now + ticks, end
        self._end_what_is_due()

    def cancel(self, goal_id: str) -> bool:
        return goal_id in self.live

    def on_answered(self, request: Request) -> None:
        if request.kind == "cancel" and request.goal_id in self.live:
            self._end(request.goal_id, "x")

    def _end_what_is_due(self) -> None:
        for goal_id, (due, end) in list(self.live.items()):
            if due <= self._world.now:
                self._end(goal_id, end)

    def _end(self, goal_id: str, end: str) -> None:
        del self.live[goal_id]
        self._world.saw.append(f"{self._name}{end}")
        self._wire.end(goal_id, STATUSES[end])
        self._wire.finish(goal_id, MoveRobot.Result())


class World:
    """A case, and what is there for its tree, which is written into `folder`."""

    def __init__(self, case: Case, folder: Path) -> None:
        """Raises NotYet where the language cannot say the tree."""
        file = write(case, folder)
        self.case = case
        self.now = 0
        """The number of the tick."""
        self.saw: list[str] = []
        """What the servers saw in this tick."""
        self.network = Network()
        self.servers = {name: Server(self, name) for name in case.acts}
        self._topics = {
            name: self.network.publisher(Bool, name, latched=True) for name in case.conds
        }
        self._root = load_tree(file)
        self._loops = []
        for node in self._root.iterate():
            if isinstance(node, Repeat) and not node.name.startswith(ROUND_A_TICK):
                self._loops.append(node)
            if isinstance(node, ActionBehaviour):
                update = self.servers[node.name].before(node.update)
                node.update = update  # type: ignore[method-assign]
        self._backend = VirtualBackend(self.network, host=PromptHost(self.network))
        tree = BehaviourTree(self._root)
        tree.setup(node=self._backend)  # so that conditions are heard before the first tick
        self._loop = TickLoop(tree, self._backend)
        self._runs = False

    def play(self) -> list[Tick]:
        """Play the case to its end."""
        ticks = [self._tick(number) for number in range(len(self.case.expected))]
        self._loop.shutdown()
        self._backend.traffic.destroy()
        self._loop.close()
        return ticks

    def _tick(self, number: int) -> Tick:
        self.now, moment = number, number * self.case.seconds
        while self.network.timeline.advance(moment):
            pass
        for name, answers in self.case.conds.items():
            answer = answers[min(number, len(answers) - 1)]
            self._topics[name].publish(Bool(data=answer == "S"))
        for name, value in values_of(self.case.scripts.get(number, "")).items():
            getattr(self._root, LOADED).scope.write(name, value)
        self.network.settle()
        status = self._tick_tree()
        events, halted = self._take(), ""
        if number in self.case.halts and status is Status.RUNNING:
            self._loop.interrupt(moment)
            self._step()
            halted = self._take()
        if number in self.case.halts:
            for node in self._root.iterate():
                if isinstance(node, InTurn):
                    InTurn.shutdown(node)  # the halt of a tree is its end there
        return Tick(status.name[0], events, halted)

    def _tick_tree(self) -> Status:
        """Tick the tree, and again as the head of this file says."""
        while True:
            ran = {loop for loop in self._loops if loop.decorated.status is Status.RUNNING}
            status = self._step()
            due = {
                loop
                for loop in self._loops
                if loop.status is Status.RUNNING and loop.due_in() == 0.0
            }
            if status is not Status.RUNNING or not (due & ran if self.case.is_exact else due):
                return status

    def _step(self) -> Status:
        """Tick the tree once; where its run is over, begin another one."""
        if not self._runs:
            if self._root.status is not Status.INVALID:
                self._root.stop(Status.INVALID)  # no clock of the root's runs on
            self._loop.begin(self.network.now())
        step = self._loop.step(self.network.now())
        self._runs = not isinstance(step, Done)
        return step.result if isinstance(step, Done) else Status.RUNNING

    def _take(self) -> str:
        saw, self.saw = " ".join(self.saw), []
        return saw
