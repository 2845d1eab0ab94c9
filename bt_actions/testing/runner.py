"""The runner of a tree in virtual time, on the loop of running/loop.py: to its end, or in steps.

No thread, no wait: between two steps the time jumps to the next event.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions.events import AttemptEnded
from bt_actions.running.loop import TickLoop
from bt_actions.story.state import State
from bt_actions.story.why import why_text
from bt_actions.testing.backend import VirtualBackend
from bt_actions.testing.network import VirtualNetwork
from bt_actions.utilities.shorten import fit
from bt_actions.utilities.stepping import Done, Sleep

if TYPE_CHECKING:
    from bt_actions.events import Event, Observer
    from bt_actions.goals.policy import Outcome
    from bt_actions.goals.unaccounted import GoalReport

LONGEST = 3600.0
"""Virtual seconds that a run may take without a timeout of its own."""


class VirtualRunner:
    """A runner of one tree on a virtual network."""

    def __init__(
        self,
        root_or_behaviour_tree: Behaviour | BehaviourTree,
        network: VirtualNetwork | None = None,
        *,
        seed: int = 0,
        heartbeat: float = 0.1,
    ) -> None:
        """Set up nothing yet; `seed` chooses goal ids and the pauses before retries.

        Without a `network` the tree is alone.
        """
        if not isinstance(network, VirtualNetwork | None):
            raise TypeError(f"{network!r} is no VirtualNetwork, on which servers and trees are")
        tree = root_or_behaviour_tree
        self.tree = tree if isinstance(tree, BehaviourTree) else BehaviourTree(tree)
        self.network = network or VirtualNetwork()
        self.backend = VirtualBackend(self.network, seed=seed)
        self.events: list[Event] = []
        """The events of all runs; times are virtual."""
        self.state = State()
        """The state of the latest run."""
        self.outcomes: list[tuple[str, Outcome]] = []
        """The leaf and its outcome for each attempt that is over, in order."""
        self._woken = self._goes_on = False
        self._status: Status | None = None
        """None before the first run."""
        self._loop = TickLoop(
            self.tree,
            self.backend,
            heartbeat=heartbeat,
            wake=self._wake,
        )
        self._loop.observe_events(self._note)

    def __repr__(self) -> str:
        """Tell why the run failed, or waits: pytest prints it where an assertion fails."""
        why = fit(why_text(self.state, self.now).partition("\n")[0], 150)
        return f"<VirtualRunner of {self.tree.root.name!r} at {self.now:g} s{why and f': {why}'}>"

    @property
    def now(self) -> float:
        """The virtual time in seconds."""
        return self.network.timeline.now

    @property
    def unaccounted(self) -> list[GoalReport]:
        """The goals whose end is UNKNOWN, and which may still be running.

        Raises RuntimeError while a run goes on, as its goals have yet to end.
        """
        if self._goes_on:
            raise RuntimeError("the run goes on: let it end first, with advance() or run()")
        return self._loop.goals.unaccounted

    def observe_events(self, callback: Observer) -> None:
        """Call `callback` with each event from now on."""
        self._loop.observe_events(callback)

    def run(self, timeout: float = LONGEST) -> Status:
        """Run the tree to its end, and drain its goals; return its status.

        The messages that the tree has sent have arrived then. A run that `start` began goes on,
        with its own timeout. Raises TimeoutError when the run has not ended after so many virtual
        seconds, and TreeError when a behaviour raised.
        """
        if not self._goes_on:
            self.start(timeout)
        status = self.advance(float("inf"))
        assert status is not None
        return status

    def start(self, timeout: float = LONGEST) -> None:
        """Begin a run, for `advance` to go on with. Raises RuntimeError while another goes on."""
        if self._goes_on:
            raise RuntimeError("this tree is running already: let it end, with advance() or run()")
        self._loop.begin(self.now, timeout)
        self._woken = self._goes_on = True
        self._status, self._next = Status.INVALID, self.now

    def advance(self, seconds: float) -> Status | None:
        """Let so much time pass; return the tree's status if the tree has ended by then.

        Returns when the tree has ended and its messages have arrived; after that, time passes
        without the tree. INVALID means an interrupt. Raises what `run` raises, and RuntimeError
        before the first `start`.
        """
        if self._status is None:
            raise RuntimeError("no run was begun: call start() before advance()")
        until = self.now + seconds
        while self._goes_on:
            while not self._woken and self.network.timeline.advance(min(self._next, until)):
                pass
            if not self._woken and self.now < self._next:
                return None
            self._woken = self._goes_on = False
            step = self._step()
            if isinstance(step, Done):
                self._status = step.result
                return self._status
            self._next, self._goes_on = self.now + step.seconds, True
        while self.network.timeline.advance(until):
            pass
        return self._status

    def _step(self) -> Sleep | Done[Status]:
        """Let the loop do what is due; at the end of the run, let its messages arrive."""
        step: Sleep | Done[Status] | None = None
        try:
            step = self._loop.step(self.now)
        finally:
            if not isinstance(step, Sleep):
                self.network.arrive()
        return step

    def interrupt(self) -> None:
        """Have `advance` or `run` end the run, whose goals are canceled and drained."""
        self._loop.interrupt(self.now)

    def shutdown(self) -> None:
        """Shut the leaves down, and drain their goals, as a program that ends does."""
        self._loop.shutdown()
        self.network.arrive()
        self.backend.traffic.destroy()
        self._loop.close()

    def _note(self, event: Event) -> None:
        self.events.append(event)
        self.state.fold(event)
        if isinstance(event, AttemptEnded):
            self.outcomes.append((self.state.nodes[event.node].node.name, event.outcome))

    def _wake(self) -> None:
        self._woken = True
