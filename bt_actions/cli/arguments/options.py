"""What stands on the command line of several commands: options, and how their words are read.

Imports nothing slow: every call of `bt-actions` builds all parsers.
"""

from __future__ import annotations

import argparse
import math
import re


def seconds(text: str) -> float:
    """Read a positive number of seconds from the command line."""
    return positive(text, "number of seconds")


FASTEST = 1e5
"""The largest factor for the simulation's time, and one by the smallest."""


def speed(text: str) -> float:
    """Read a factor from the command line, with which timers can still be made."""
    value = positive(text, "factor")
    if not 1.0 / FASTEST <= value <= FASTEST:
        raise argparse.ArgumentTypeError(f"{text!r} is not from {1.0 / FASTEST:g} to {FASTEST:g}")
    return value


def positive(text: str, what: str) -> float:
    """Read a positive, finite number; argparse reports the error."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no positive {what}")
    return value


def metres(text: str) -> float:
    """Read a finite number of metres from the command line."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is no number of metres")
    return value


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


def add_set(parser: argparse.ArgumentParser) -> None:
    """Add the option of every command that gives inputs of a tree their values."""
    parser.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="give an input of the tree a value; repeatable",
    )


def add_no_python(parser: argparse.ArgumentParser) -> None:
    """Add the option of every command that reads a tree with its `python:` nodes."""
    parser.add_argument(
        "--no-python",
        dest="python",
        action="store_false",
        help="refuse a tree with python: nodes, and import no class for it; for trees that are "
        "not trusted",
    )
