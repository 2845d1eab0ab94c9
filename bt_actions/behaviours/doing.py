"""Leaves that do something small and are done: set variables, write to the log."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.traffic.backend import Backend
from bt_actions.wiring import backend_of

LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}


class SetValues(Behaviour):
    """Computes values and writes them, all or none; fails when one cannot be computed.

    Args:
        name: as in py_trees.
        values: gives the values by name; may raise ValueError.
        write: puts them where the tree reads them; may raise ValueError.
    """

    def __init__(
        self,
        name: str,
        values: Callable[[], Mapping[str, object]],
        write: Callable[[Mapping[str, object]], None],
    ) -> None:
        super().__init__(name)
        self._values = values
        self._write = write

    def update(self) -> Status:
        try:
            self._write(self._values())
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self.feedback_message = ""
        return Status.SUCCESS


class Log(Behaviour):
    """Writes a line to the node's log (Python's where there is no node), and succeeds.

    Args:
        name: as in py_trees.
        text: gives the line; may raise ValueError, which is logged instead and fails.
        level: one of `LEVELS`.
    """

    def __init__(self, name: str, text: Callable[[], object], level: str = "info") -> None:
        super().__init__(name)
        if level not in LEVELS:
            raise ValueError(f"level must be one of {', '.join(LEVELS)}, not {level!r}")
        self._text = text
        self._level = level
        self._backend: Backend | None = None

    def setup(self, **kwargs: Any) -> None:
        node = kwargs.get("node")
        self._backend = None if node is None else backend_of(node)

    def update(self) -> Status:
        try:
            line = str(self._text())
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self.feedback_message = line
        if self._backend is None:
            logging.getLogger("bt_actions").log(LEVELS[self._level], "%s", line)
        else:
            self._backend.log(self._level, line)
        return Status.SUCCESS
