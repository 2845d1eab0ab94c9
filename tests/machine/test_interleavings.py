"""Every interleaving of events keeps the rules (judge.py); hypothesis shrinks one that does not.

A failure prints the moves of the shortest history found and, by `note`, what they did.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import note, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from tests.machine.conftest import THOROUGH
from tests.machine.histories import UNUSUAL, USUAL, Play

NUMBERS = st.integers(0, 999)


class Interleavings(RuleBasedStateMachine):
    """One world; a rule for each kind of move, with a number that says which of its choices."""

    def __init__(self) -> None:
        super().__init__()
        self.play: Play | None = None
        self.number = 0
        self.broken = False

    @initialize(plans=st.lists(st.integers(0, 9_999), min_size=1, max_size=3))
    def begin(self, plans: list[int]) -> None:
        self.number = plans[0]

        def play() -> None:
            self.play = Play(plans, aloud=True)

        self._do(play)

    @rule()
    def exchange(self) -> None:
        """Let all that is under way arrive, in order."""
        for _ in range(len(self.play.world.air)):
            self._do(lambda: self.play.move("deliver", 0))

    @rule()
    def obey(self) -> None:
        """Let the tree begin and the server accept."""
        for kind in ("tick", "deliver", "answer", "deliver"):
            self._do(lambda kind=kind: self.play.move(kind, 0))

    def _do(self, move: Callable[[], object]) -> None:
        try:
            move()
        except BaseException:
            self.broken = True
            raise
        finally:
            if self.play is not None and self.play.told:
                note("\n".join(self.play.told))
                self.play.told.clear()

    def teardown(self) -> None:
        if self.play is not None and not self.broken:
            self._do(lambda: self.play.finish(self.number))

    def _make(kind: str) -> Callable[..., None]:  # noqa: N805 - not a method: it makes the rules
        def move(self: Interleavings, number: int) -> None:
            self._do(lambda: self.play.move(kind, number))

        move.__name__ = kind
        possible = precondition(lambda self: bool(self.play and self.play.world.options(kind)))
        return possible(rule(number=NUMBERS)(move))

    for _kind in (*USUAL, *UNUSUAL):
        locals()[_kind] = _make(_kind)


TestInterleavings = pytest.mark.timeout(600)(Interleavings.TestCase)
TestInterleavings.settings = settings.get_profile("machine-ci" if THOROUGH else "machine")
