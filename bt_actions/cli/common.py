"""What several commands share: exit codes, the error for bad input, and reading arguments.

Imports nothing slow: every call of `bt-actions` loads this file.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from enum import IntEnum
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TextIO

from bt_actions.cli.results import results

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from bt_actions.document import DocumentError


class Exit(IntEnum):
    """The exit codes of every command that runs goals; the others use the first three."""

    SUCCESS = 0
    FAILURE = 1
    BAD_INPUT = 2
    UNKNOWN = 3
    """The end of a goal is not known: it may still be running. Wins over all others."""
    TIMEOUT = 124
    SIGHUP = 129
    SIGINT = 130
    SIGQUIT = 131
    SIGPIPE = 141
    """Nobody reads standard output any more."""
    SIGTERM = 143


class BadInput(Exception):
    """What the user gave cannot be used; the text says what, where and what to do. Exit code 2."""

    def __init__(self, message: str, *, prefixed: bool = True) -> None:
        """`prefixed` is False for messages that begin with their own file:line:column."""
        super().__init__(message)
        self.prefixed = prefixed


def no_ros(error: ImportError) -> BadInput:
    """Return what to say where ROS cannot be imported.

    Raises KeyboardInterrupt where that is why: a C extension makes an ImportError of it.
    """
    if isinstance(error.__cause__, KeyboardInterrupt):
        raise error.__cause__
    return BadInput(
        f"ROS 2 cannot be imported ({error}); source your workspace, or install bt_actions with "
        "its dependencies"
    )


class OutputLost(Exception):
    """Standard output cannot be written, for another reason than that nobody reads it."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"standard output cannot be written: {error.strerror or error}")


def write(text: str) -> None:
    """Write `text` to standard output, at once.

    Raises OutputLost, or BrokenPipeError when nobody reads any more.
    """
    try:
        results().write(text)
        results().flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputLost(error) from error


def discard_stdout() -> None:
    """Write to nowhere from now on, what is left in the buffer too."""
    _discard(results())


def _discard(stream: TextIO) -> None:
    """Without this, Python fails to flush the stream at exit, and makes the exit code 120."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def note(message: str, end: str = "\n") -> None:
    """Write one message for the user to standard error, whoever may still be reading it."""
    try:
        print(message, file=sys.stderr, flush=True, end=end)
    except (OSError, ValueError):
        _discard(sys.stderr)


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
    from bt_actions.document.ros_names import LONGEST_NAMESPACE

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


HIGHEST_DOMAIN = 232


def refuse_domain() -> None:
    """Raise BadInput for what is no ROS domain; of one too high, Fast DDS would end the process."""
    domain = os.environ.get("ROS_DOMAIN_ID", "")
    digits = domain.strip().removeprefix("+").lower()
    base = 16 if digits.startswith("0x") else 8 if digits.startswith("0") else 10  # as rcl reads it
    with contextlib.suppress(ValueError):  # of which rcl says why
        if int(digits, base) > HIGHEST_DOMAIN:
            text = f"ROS_DOMAIN_ID is {domain!r}; a domain is a number from 0 to {HIGHEST_DOMAIN}"
            raise BadInput(f"ROS 2 cannot start: {text}")


@contextlib.contextmanager
def starting_ros() -> Iterator[None]:
    """Turn what ROS raises when it is first touched into BadInput."""
    refuse_domain()
    try:
        yield
    except RuntimeError as error:  # rclpy's RCLError
        raise BadInput(f"ROS 2 cannot start: {str(error).splitlines()[0]}") from error


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


def load(
    tree: str,
    settings: Iterable[str],
    *,
    python: bool = True,
    parameters: Mapping[str, object] = MappingProxyType({}),
) -> Behaviour:
    """Load a tree by path or by the name of an installed one, with `--set` words for its inputs.

    Where they say nothing, ROS parameters by the names of inputs do. With `python=False` a tree
    with a `python:` node is refused, and nothing it names is imported.

    Raises BadInput with all findings, or about the first input that does not fit.
    """
    from bt_actions.cli.ros_arguments import as_inputs
    from bt_actions.document import (
        DocumentError,
        InputError,
        TreeNotFoundError,
        find_tree,
        load_tree,
        parse_input,
        tree_inputs,
    )

    texts: dict[str, str] = {}
    for word in settings:
        name, text = split(word, "--set")
        if name in texts:
            raise BadInput(f"--set {name} is given twice: {texts[name]!r} and {text!r}")
        texts[name] = text
    try:
        found = find_tree(tree)
        if Path(tree).suffix and found != Path(tree) and "://" not in tree:
            note(f"bt-actions: there is no {tree} in this folder; taking the installed {found}")
        declared = tree_inputs(tree) if texts or parameters else {}
        inputs = as_inputs(parameters, declared, tree)
        for name, text in texts.items():
            kind = declared[name].type if name in declared else "string"
            try:
                inputs[name] = parse_input(text, kind)
            except ValueError as error:
                raise BadInput(f"--set {name}={text}: {error}") from error
        return load_tree(tree, inputs, python=python)
    except DocumentError as error:
        raise BadInput(findings_text(error), prefixed=False) from error
    except (InputError, TreeNotFoundError) as error:
        raise BadInput(str(error)) from error


def findings_text(error: DocumentError) -> str:
    """What is wrong with a document, for standard error."""
    return "\n".join(finding.text(columns(sys.stderr)) for finding in error.findings)


def columns(stream: TextIO) -> int:
    """Return the width of the terminal behind `stream`; 200 where there is none."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or 200
    except (OSError, ValueError):
        return 200


def split(word: str, what: str) -> tuple[str, str]:
    """Split `name=value`; raise BadInput, beginning with `what`, for anything else."""
    name, equals, text = word.partition("=")
    if not equals or not name.strip():
        raise BadInput(f"{what} {word!r}: expected name=value, as in distance=2.0")
    return name.strip(), text
