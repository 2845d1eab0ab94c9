"""The state of each served tree, on /diagnostics once a second. Changes nothing."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.serving.catalog import FileState
from bt_actions.serving.outcome import RunOutcome
from bt_actions.story.state import State
from bt_actions.story.why import waits

PERIOD = 1.0
"""Seconds between two messages."""
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class TreeStanding(NamedTuple):
    """The standing of a tree: its file, its runs, and its last run."""

    tree: str
    state: FileState = FileState.OK
    running: int = 0
    paused: int = 0
    """The number of running ones that are paused."""
    retrying: bool = False
    doing: tuple[str, ...] = ()
    """A line for each leaf that runs."""
    last: RunOutcome | None = None
    """The outcome of its last run."""

    def beside(self, run: State, *, paused: bool) -> TreeStanding:
        """Return the standing with one more run."""
        return self._replace(
            running=self.running + 1,
            paused=self.paused + paused,
            retrying=self.retrying or run.retries,
            doing=(*self.doing, *waits(run, time.monotonic())),
        )


def judge(standing: TreeStanding, refuses: str) -> tuple[bytes, str]:
    """Return the level of a tree, and the reason; `refuses` is why its server accepts nothing."""
    last, running = standing.last, standing.running
    if refuses:
        return ERROR, f"not serving: {refuses}"
    if standing.state is FileState.INVALID:
        return ERROR, "its file does not check"
    if last is not None and not last.settled:
        return ERROR, f"the last run is not settled: {last.unaccounted[0]} may still be running"
    if last is not None and not last.as_wanted and not running:
        return WARN, f"the last run failed: {last.why.partition(chr(10))[0]}"
    if standing.paused:
        return WARN, "paused"
    if standing.retrying:
        return WARN, "an action is tried again"
    if standing.state is FileState.KEPT_LAST_GOOD:
        return WARN, "its file does not check; the last good version is used"
    return OK, "running" if running else "ready"


class Diagnostics:
    """The publisher of `look`: the standings of the trees, and why the server accepts nothing.

    `submit` runs `look`, on other threads than the executor's. A server that `yields` to another,
    which may have a node of the same name, has its process in the names.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        look: Callable[[], tuple[Iterable[TreeStanding], str]],
        submit: Callable[[Callable[[], None]], object],
        yields: Callable[[], bool],
    ) -> None:
        self._node, self._look, self._submit = endpoints.node, look, submit
        self._yields = yields
        self._publisher = endpoints.publisher(DiagnosticArray, "/diagnostics", 10)
        endpoints.timer(PERIOD, self._on_timer)

    def _on_timer(self) -> None:
        with contextlib.suppress(RuntimeError):  # the server is closed at this moment
            self._submit(self._tell)

    def _tell(self) -> None:
        standings, refuses = self._look()
        who = self._node.get_fully_qualified_name()
        if self._yields():
            who += f" (process {os.getpid()})"
        message = DiagnosticArray(status=[self._status(who, each, refuses) for each in standings])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _status(self, who: str, standing: TreeStanding, refuses: str) -> DiagnosticStatus:
        level, message = judge(standing, refuses)
        values = {
            "state": standing.state.name,
            "running": str(standing.running),
            "paused": str(standing.paused),
            "doing": "; ".join(standing.doing),
            "last_error_code": "" if standing.last is None else str(standing.last.code),
        }
        return DiagnosticStatus(
            level=level,
            name=f"{who}: {standing.tree}",
            message=message,
            hardware_id=self._node.get_namespace(),
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
