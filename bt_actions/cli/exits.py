"""The end of a command: exit codes, bad input, and a ROS that is missing or cannot start.

Imports nothing slow: every call of `bt-actions` loads this file.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from enum import IntEnum
from typing import NoReturn

from bt_actions.cli.streams.results import results


class Exit(IntEnum):
    """The exit codes of every command that runs goals; the others use the first three."""

    SUCCESS = 0
    FAILURE = 1
    BAD_INPUT = 2
    UNKNOWN = 3
    """The end of a goal is not known: the goal may still run. Wins over all other codes."""
    TIMEOUT = 124
    SIGHUP = 129
    SIGINT = 130
    SIGQUIT = 131
    SIGPIPE = 141
    """Standard output has no reader any more."""
    SIGTERM = 143


class BadInput(Exception):
    """Input that cannot be used; the text says what, where and what to do. Exit code 2."""

    def __init__(self, message: str, *, prefixed: bool = True) -> None:
        """Take the text; `prefixed` is False for one that begins with its own file:line:column."""
        super().__init__(message)
        self.prefixed = prefixed


@contextlib.contextmanager
def importing_ros() -> Iterator[None]:
    """Turn a failed import of ROS into BadInput.

    Raises KeyboardInterrupt where that is the cause: a C extension makes an ImportError of it.
    """
    try:
        yield
    except ImportError as error:
        if isinstance(error.__cause__, KeyboardInterrupt):
            raise error.__cause__ from None
        raise BadInput(
            f"ROS 2 cannot be imported ({error}); source your workspace, or install bt_actions "
            "with its dependencies"
        ) from error


HIGHEST_DOMAIN = 232


def refuse_domain() -> None:
    """Raise BadInput for what is no ROS domain; at one too high, Fast DDS ends the process."""
    domain = os.environ.get("ROS_DOMAIN_ID", "")
    digits = domain.strip().removeprefix("+").lower()
    base = 16 if digits.startswith("0x") else 8 if digits.startswith("0") else 10  # as rcl reads it
    with contextlib.suppress(ValueError):  # rcl names the mistake
        if int(digits, base) > HIGHEST_DOMAIN:
            text = f"ROS_DOMAIN_ID is {domain!r}; a domain is a number from 0 to {HIGHEST_DOMAIN}"
            raise BadInput(f"ROS 2 cannot start: {text}")


@contextlib.contextmanager
def starting_ros() -> Iterator[None]:
    """Turn an error of ROS's first use into BadInput."""
    refuse_domain()
    try:
        yield
    except RuntimeError as error:  # rclpy's RCLError
        raise BadInput(f"ROS 2 cannot start: {str(error).splitlines()[0]}") from error


def leave(code: Exit) -> NoReturn:
    """Exit at once: threads of rclpy still run, and its teardown would wait for them."""
    for stream in (results(), sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)
