"""What our trees do in the cases of the oracle, beside what BehaviorTree.CPP did."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.support.oracle.cases import Case
from tests.support.oracle.world import World
from tests.support.oracle.writing import NotYet, Writer

DIFFERENCES = Path(__file__).parents[2] / "oracle" / "differences.txt"


def sayable(cases: Iterable[Case]) -> Iterator[Case]:
    """Leave out the cases whose trees the language cannot say yet."""
    for case in cases:
        try:
            Writer(case)
        except NotYet:
            continue
        yield case


def difference(case: Case, file: Path) -> str:
    """Play a case, whose tree is written into `file`; tell the first tick that differs, or ""."""
    world = World(case, file)
    played = world.play()
    assert not any(server.live for server in world.servers.values()), f"{case.id}: goals are left"
    for number, (here, there) in enumerate(zip(played, case.expected, strict=True)):
        if here != there:
            return f"{case.id}, tick {number}: {here} (BehaviorTree.CPP: {there})"
    return ""


def listed(file: Path = DIFFERENCES) -> dict[str, str]:
    """The cases that are known to differ, and why."""
    found, reason = {}, ""
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith(" "):
            found |= dict.fromkeys(line.split(), reason)
        elif not line.startswith("#"):
            reason = line
    return found
