"""docs/simulation.md says what the code does."""

from pathlib import Path

import pytest

from bt_actions.simulation.faults import FaultKind, Unit
from bt_actions.simulation.journal import Event

TEXT = (Path(__file__).parents[2] / "docs" / "simulation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", FaultKind)
def test_every_fault_has_a_row_with_its_default(kind: FaultKind) -> None:
    [row] = [line for line in TEXT.splitlines() if line.startswith(f"| `{kind}` |")]
    value = row.split("|")[3].strip()
    assert bool(value) == (kind.unit is not Unit.NONE)
    if isinstance(kind.default, float):
        assert value.endswith(f", {kind.default:g}")


@pytest.mark.parametrize("event", Event)
def test_every_event_of_the_journal_is_named(event: Event) -> None:
    assert f"`{event}`" in TEXT
