"""Tests of trees in virtual time, without ROS: a network, simulated servers, a runner.

The same code decides as on a robot. Only time and messages are played, so that a minute takes a
tenth of a second and each run is the same. The servers are those of `bt_actions.simulation`, with
all their faults: give them a VirtualNetwork in place of a node.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from bt_actions.testing.backend import VirtualBackend
from bt_actions.testing.network import VirtualNetwork
from bt_actions.testing.runner import VirtualRunner

if TYPE_CHECKING:
    from bt_actions.simulation import RecordedServers, Script, ScriptedServer, Simulation
    from bt_actions.testing.recorded import serve_as_recorded

__all__ = [
    "RecordedServers",
    "Script",
    "ScriptedServer",
    "Simulation",
    "VirtualBackend",
    "VirtualNetwork",
    "VirtualRunner",
    "serve_as_recorded",
]


def __getattr__(name: str) -> object:
    if name in __all__:
        late = "testing.recorded" if name == "serve_as_recorded" else "simulation"
        return getattr(importlib.import_module(f"bt_actions.{late}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
