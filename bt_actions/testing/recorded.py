"""Simulated servers that act as the servers of a recorded run did."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

from bt_actions.events import Event
from bt_actions.recording.folders import find
from bt_actions.recording.reading import Recording, RecordingError
from bt_actions.simulation.recorded.servers import RecordedServers
from bt_actions.story.state import State


def serve_as_recorded(
    node: Any, tree: Behaviour, run: str | Path, **settings: Any
) -> RecordedServers:
    """Serve each action of `tree` on `node` as it was served in a recorded run.

    `run` is a file or folder of a recording, the first letters of a run's id, or a tree, whose
    newest run is meant. `settings` are those of RecordedServers.

    Raises NoRun (a LookupError), RecordingError (a ValueError), and FaultError (another one).
    """
    try:
        servers = RecordedServers(node, tree, _events(str(run)), **settings)
    except RecursionError as error:
        raise RecordingError(f"{run} holds values within values without an end") from error
    if servers.run.began is None:
        servers.close()
        raise RecordingError(f"{run} holds no run")
    return servers


def _events(run: str) -> Iterator[Event]:
    """Yield the recorded events, without the states that stand in place of missing ones."""
    return (each for each in Recording(find(run)).items() if not isinstance(each, State))
