"""The site shows every public name. `make site` itself fails at a link that leads nowhere."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

import bt_actions
from bt_actions import events, testing

ROOT = Path(__file__).resolve().parents[1]
SHOWN = set(
    re.findall(r"^\.\. auto\w+:: (\S+)$", (ROOT / "docs" / "python.md").read_text(), re.MULTILINE)
)
NO_PAGE = {
    *("events.Observer", "events.Value", "events.from_line", "events.to_line"),
    "testing.Simulation",
}
"""Aliases, the wire form (events.md) and the simulated robot (simulation.md)."""


@pytest.mark.parametrize("module", [bt_actions, events, testing], ids=lambda one: one.__name__)
def test_every_public_name_is_on_the_page(module: ModuleType) -> None:
    public = {f"{module.__name__}.{name}" for name in module.__all__}
    assert public - SHOWN == {f"bt_actions.{name}" for name in NO_PAGE} & public
    assert all(hasattr(module, name.rpartition(".")[2]) for name in public & SHOWN)
