"""Options that several commands share, and the reading of their words.

Imports nothing slow: every call of `bt-actions` builds all parsers.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bt_actions.simulation.faults import Fault

MOST = 1000
"""The most goals, robots and the like of one server."""


def number(
    what: str, kind: Callable[[str], Any] = float, least: float = -math.inf, most: float = math.inf
) -> Callable[[str], Any]:
    """Return a reader of numbers within bounds; argparse's error calls the number `what`."""

    def read(text: str) -> Any:
        try:
            value = kind(text) if text.isascii() else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no {what}")
        return value

    return read


seconds = number("positive number of seconds", least=math.ulp(0.0))
metres = number("number of metres")
speed = number("factor from 1e-05 to 100000", least=1e-5, most=1e5)


def count(what: str) -> Callable[[str], Any]:
    """Return a reader of counts; the error calls the counted things `what`."""
    return number(f"number of {what}, 1 to {MOST}", int, 1, MOST)


def namespace(text: str) -> str:
    """Read a ROS namespace; return it with a leading slash, or "" for the root."""
    name = text.strip("/")
    if name and not re.fullmatch(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*", name, flags=re.ASCII):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no ROS namespace: letters, digits and _ between slashes, as in /r1"
        )
    from bt_actions.document.language.ros_names import LONGEST_NAMESPACE

    if len(name) > LONGEST_NAMESPACE:
        raise argparse.ArgumentTypeError(f"a namespace has at most {LONGEST_NAMESPACE} characters")
    return f"/{name}" if name else ""


def node_name(text: str) -> str:
    """Read the name of a node."""
    if not re.fullmatch(r"[A-Za-z_]\w{0,99}", text, flags=re.ASCII):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no name of a node: letters, digits and _, at most 100, no digit first"
        )
    return text


def action_name(text: str) -> str:
    """Read the name of an action, which may be relative."""
    from bt_actions.document.language.ros_names import why_not

    if why := why_not(text):
        raise argparse.ArgumentTypeError(f"{text!r} cannot be the name of an action server: {why}")
    return text


def fault(text: str) -> Fault:
    """Read a fault of a simulated server."""
    from bt_actions.simulation.faults import Fault, FaultError

    try:
        return Fault.parse(text)
    except FaultError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


_SHARED: dict[str, dict[str, Any]] = {
    "--set": {
        "metavar": "NAME=VALUE",
        "action": "append",
        "default": [],
        "help": "give an input of the tree a value; repeatable",
    },
    "--no-python": {
        "dest": "python",
        "action": "store_false",
        "help": "for trees that you do not trust: refuse python: nodes, and import no class of "
        "the tree",
    },
    "--executor": {
        "choices": ("multi", "single"),
        "default": "multi",
        "help": "rclpy's multi-threaded (default) or single-threaded executor",
    },
    "--namespace": {"metavar": "NS", "type": namespace, "default": ""},
    "--timeout": {
        "metavar": "S",
        "type": seconds,
        "help": "cancel after S seconds, with exit code 124",
    },
    "--json": {"action": "store_true", "help": "print one JSON object a line, the result last"},
    "--quiet": {
        "action": "store_true",
        "help": "show only failures; the exit code has the end",
    },
    "--publish-values": {
        "action": "store_true",
        "help": "publish goals, results, feedback, variables, inputs and outputs on ~/events and "
        "~/tree, too, for everybody in the ROS domain; never secrets",
    },
    "--fault": {"metavar": "SPEC", "type": fault, "action": "append", "default": []},
    "--speed": {"metavar": "N", "type": speed},
    "--seed": {"metavar": "N", "type": int, "help": "seed for faults by chance"},
}
_SHORT = {"--quiet": "-q"}


def add_option(parser: argparse._ActionsContainer, name: str, **other: Any) -> None:
    """Add an option that several commands have; `other` replaces its usual settings."""
    names = [_SHORT[name], name] if name in _SHORT else [name]
    parser.add_argument(*names, **_SHARED[name] | other)
