"""What our trees do in the cases of the oracle, beside what BehaviorTree.CPP did."""

from __future__ import annotations

from pathlib import Path

from tests.support.oracle.cases import Case
from tests.support.oracle.world import World

DIFFERENCES = Path(__file__).parents[2] / "oracle" / "differences.txt"


def difference(case: Case, folder: Path) -> str:
    """Play a case, written into a folder; tell the first tick that differs, or "".

    Raises NotYet.
    """
    world = World(case, folder)
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
