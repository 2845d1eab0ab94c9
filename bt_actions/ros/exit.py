"""The end of the process, and its goals: by itself, by a signal, or as the child of a fork.

Sends nothing but what a drain does.
"""

from __future__ import annotations

import atexit
import contextlib

from bt_actions.goals.policy import End
from bt_actions.goals.unaccounted import report_of
from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.signals import ended_by_signals
from bt_actions.traffic.drain import drain


def close_process() -> None:
    """Close what a loop that crashed, or never called shutdown, has left; send nothing more.

    For a process that ends: this cannot be undone. A first signal meanwhile waits, and a second one
    ends the wait.
    """
    hurried = False

    def hurry(again: bool, _ends_process: bool) -> None:
        nonlocal hurried
        hurried |= again

    with contextlib.suppress(KeyboardInterrupt), ended_by_signals(hurry):
        with host.lock:
            host.closing = True
            left = [
                handle
                for domain in host.domains.values()
                for endpoint in domain.open
                for handle in endpoint.handles
                if not handle.goal.lost or handle.looked_out_for
            ]
        try:
            drain(host, left, lambda: hurried)
        finally:
            for handle in left:
                is_logged = handle.end_logged is End.UNKNOWN
                if not handle.is_over and not is_logged:
                    log.error(report_of(handle.goal, handle.name).alarm)
            host.record.close()
            log.flush()


def disown() -> None:
    """Let go of all goals in the child of a fork: they and their guards are the parent's."""
    atexit.unregister(close_process)
    host.disown()
