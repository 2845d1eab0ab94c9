"""What a server says of itself: on the log, with its node's full name, and on /rosout."""

from __future__ import annotations

from typing import Any

from bt_actions.ros.log import log
from bt_actions.ros.rosout import Level, Rosout


class Telling:
    """Says one line in both places; on any thread."""

    def __init__(self, node: Any) -> None:
        self._name = node.get_fully_qualified_name()
        self._rosout = Rosout(node)

    def __call__(self, level: Level, text: str) -> None:
        """Say it."""
        put = {"info": log.info, "warn": log.warning, "error": log.error}[level]
        put(f"{self._name}: {text}")
        self._rosout.say(level, text)

    def close(self) -> None:
        """Say nothing more on /rosout; the node is still there."""
        self._rosout.close()
