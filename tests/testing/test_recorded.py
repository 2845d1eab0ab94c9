"""Servers of a recording on the virtual network: which file is meant, and which is none."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.writer import Writer

from bt_actions import MoveRobot
from bt_actions.recording.folders import NoRun
from bt_actions.recording.reading import RecordingError
from bt_actions.testing import VirtualNetwork, serve_as_recorded


def test_a_file_in_which_no_run_begins_is_refused_and_nothing_is_served(tmp_path: Path) -> None:
    path, network = tmp_path / "bag.mcap", VirtualNetwork()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(RecordingError, match="holds no run"):
        serve_as_recorded(network, MoveRobot("A", 1.0), path)
    assert network.actions == {}


def test_a_run_that_is_not_recorded_is_refused() -> None:
    with pytest.raises(NoRun, match="no run is recorded yet"):
        serve_as_recorded(VirtualNetwork(), MoveRobot("A", 1.0), "night")
