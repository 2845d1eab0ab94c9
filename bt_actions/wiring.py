"""The one door to ROS: from a node, or nothing, to the tools of leaves and runs.

Behaviours and runs ask here. The first question imports rclpy, not the import of this file: trees
are loaded, checked and drawn without it. Nothing is kept or decided here.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from bt_actions.traffic.backend import Backend
from bt_actions.traffic.state import Record

if TYPE_CHECKING:
    from bt_actions.ros.log import Log
    from bt_actions.ros.rosout import Rosout
    from bt_actions.ros.spinning import Spinner


def backend_of(node: Any) -> Backend:
    """Return the Backend of a node; a Backend itself is returned as it is.

    Raises TypeError for neither.
    """
    if isinstance(node, Backend):
        return node
    if not hasattr(node, "create_client"):
        remedy = "in virtual time give VirtualBackend(network)"
        raise TypeError(f"{node!r} is neither an rclpy node nor a backend; {remedy}")
    from bt_actions.recovery.ledger import Ledger
    from bt_actions.ros.host import host
    from bt_actions.ros.node_participant import NodeParticipant

    with host.lock:
        if type(host.record) is Record:
            host.record = Ledger(host.log.warning)
        return NodeParticipant.of(node)


def spinner(died: Callable[[], None], *, may_share: bool, **given: Any) -> Spinner:
    """Return a node that is spun: one for all who may share it and bring nothing.

    See ros/spinning.py.
    """
    from bt_actions.ros.spinning import Spinner

    if may_share and all(each in (None, "") for each in given.values()):
        return Spinner.shared(died)
    return Spinner(**given, died=died)


def ended_by_signals(
    interrupt: Callable[[bool, bool], bool | None],
) -> AbstractContextManager[None]:
    """Call `interrupt` at signals that would end the process; see ros/signals.py."""
    from bt_actions.ros.exit import close_process
    from bt_actions.ros.signals import ended_by_signals

    return ended_by_signals(interrupt, close_process)


def log() -> Log:
    """Return the log of this package, whose writing holds up nobody."""
    from bt_actions.ros.log import log

    return log


def rosout(node: Any) -> Rosout:
    """Return a publisher of lines on `/rosout` for a node, which prints nothing."""
    from bt_actions.ros.rosout import Rosout

    return Rosout(node)


def where(node: Any) -> dict[str, str]:
    """Return the full name of a node, its domain, and the name of this computer."""
    from bt_actions.ros.naming import where

    return where(node)


def declare_input(node: Any, *given: Any) -> bool:
    """Show an input as a parameter of a node; see ros/parameters.py."""
    from bt_actions.ros.parameters import declare_input

    return declare_input(node, *given)
