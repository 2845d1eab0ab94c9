"""A recording of a real run."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.recording.finishing import is_finished
from tests.serving.conftest import MAIN
from tests.support.processes import Process

NIGHT = ["examples/night/night.yaml", "--sim", "--speed", "20", "--fault", "move_robot:12:abort"]


@pytest.fixture(scope="session")
def night(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The finished file of examples/night, which fails at last; nobody may change it."""
    file = tmp_path_factory.mktemp("night") / "run.mcap"
    process = Process(["-c", MAIN, "run", *NIGHT, "--record", str(file)])
    assert process.wait(60.0) == 1, process
    process.close()
    assert is_finished(file)
    return file
