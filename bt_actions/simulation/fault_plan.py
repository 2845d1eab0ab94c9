"""The plan of faults: which goal of which server each one strikes. Decided by a seed. No ROS."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from bt_actions.simulation.faults import Fault, FaultError, FaultKind, Value
from bt_actions.utilities.suggest import did_you_mean, listing


class GoalFaults(dict[FaultKind, Value]):
    """The faults that strike one goal, with their values."""

    def __str__(self) -> str:
        return ", ".join(
            str(kind) if value is None else f"{kind}={value}" for kind, value in self.items()
        )

    def number(self, kind: FaultKind) -> float | None:
        """Return the value of `kind` where it strikes and has one."""
        value = self.get(kind)
        return value if isinstance(value, float) else None

    def dies(self, phase: str) -> bool:
        """Return whether the server dies in `phase`, one of PHASES."""
        return self.get(FaultKind.DIE) == phase


@dataclass(slots=True)
class FaultPlan:
    """The choice of the faults that strike each goal.

    The dice of a goal depend on the seed, the server and the goal's number alone, so a run with the
    same seed meets the same faults however its servers take turns.
    """

    faults: Sequence[Fault] = ()
    seed: int = field(default_factory=lambda: random.SystemRandom().randrange(1_000_000))

    @classmethod
    def of(cls, faults: Iterable[Fault | str], seed: int | None = None) -> FaultPlan:
        """Make a plan from faults as values or as text; without a seed, one is chosen."""
        parsed = tuple(f if isinstance(f, Fault) else Fault.parse(f) for f in faults)
        return cls(parsed) if seed is None else cls(parsed, seed)

    @property
    def uses_chance(self) -> bool:
        """Whether a seed is worth printing: not every fault is certain."""
        return any(fault.probability < 1.0 for fault in self.faults)

    def check(self, servers: Iterable[str]) -> None:
        """Raise FaultError when a fault fits none of `servers` (fully qualified names)."""
        known = list(servers)
        for fault in self.faults:
            if not any(fault.fits(server) for server in known):
                names = sorted({*known, *(name.rpartition("/")[2] for name in known)})
                raise FaultError(
                    f"{fault}: there is no server {fault.server!r} here"
                    f"{did_you_mean(fault.server, names) or f'; there is {listing(known)}'}"
                )

    def strike(self, server: str, number: int) -> GoalFaults:
        """Return the faults of goal `number` (from 1) of `server`; later ones win over earlier."""
        struck = GoalFaults()
        for index, fault in enumerate(self.faults):
            if not fault.fits(server) or fault.number not in {None, number}:
                continue
            if fault.probability < 1.0:
                dice = random.Random(f"{self.seed} {server} {number} {index}")
                if dice.random() >= fault.probability:
                    continue
            struck[fault.kind] = fault.value
        return struck
