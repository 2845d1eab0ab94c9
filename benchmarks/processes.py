"""Processes of a benchmark: each side is one, and so is the server that it sends goals to.

They have a ROS domain of their own on this machine alone, and Fast DDS as it comes (but in row 7).
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.harness import Figures

ROOT = Path(__file__).parents[1]
DOMAIN = "44"
PATIENCE = 300.0
LOST = 3
"""Times that a side may lose a goal until that is an error: rclpy's own do (rclpy #1123)."""


def environment() -> dict[str, str]:
    """Return what all of them have around them."""
    ours = {"ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    kept = {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": ""}  # compiled once, as installed
    return {**os.environ, **ours, **kept}


def seconds(arguments: Sequence[str]) -> float:
    """Return how long a Python process takes, from start to end; raises where it fails."""
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments],
        env=environment(),
        cwd=ROOT,
        stdout=subprocess.PIPE,  # whose end is the process's; without it, Popen looks every 50 ms
        check=True,
        timeout=PATIENCE,
    )
    return time.perf_counter() - began


def seconds_to(word: str, arguments: Sequence[str]) -> float:
    """Return how long a Python process takes to a line that begins so; raises where it fails."""
    command, took = [sys.executable, *arguments], 0.0
    began = time.perf_counter()
    with subprocess.Popen(
        command, env=environment(), cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            took = took or (time.perf_counter() - began if line.startswith(word) else 0.0)
    if process.returncode or not took:
        raise Lost(f"{command} ended with {process.returncode}")
    return took


class Lost(Exception):
    """A side did not come to its end."""


def side(family: str, name: str, *arguments: object) -> Figures:
    """Run one side of a family, and return its figures."""
    command = [sys.executable, "-m", f"benchmarks.{family}", name, *map(str, arguments)]
    try:
        ran = subprocess.run(
            command,
            env=environment(),
            cwd=ROOT,
            stdout=subprocess.PIPE,
            check=True,
            timeout=PATIENCE,
        )
    except subprocess.SubprocessError as error:
        raise Lost(f"{family} {name}: {error}") from error
    figures: dict[str, float] = json.loads(ran.stdout.splitlines()[-1])
    return figures


def answer(sides: Mapping[str, Callable[..., Figures]]) -> None:
    """Be the side that the command line names."""
    name, *arguments = sys.argv[1:]
    print(json.dumps(sides[name](*map(float, arguments))), flush=True)
    sys.stdout.flush()


class Server:
    """The process of benchmarks/server.py."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.first_at = 0.0
        """When the first goal came, by the monotonic clock; known with the journal."""

    def journal(self) -> dict[str, list[int]]:
        """Return the `order` of each goal that it ran, one after the other, by action."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("journal\n")
        self._process.stdin.flush()
        said: dict[str, list[int]]
        said, first = json.loads(self._process.stdout.readline())
        self.first_at = max(first, default=0.0)
        return said


@contextlib.contextmanager
def serving(*arguments: object) -> Iterator[Server]:
    """Have a server of Fibonacci actions run; see benchmarks/server.py for its arguments."""
    command = [sys.executable, "-m", "benchmarks.server", *map(str, arguments)]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, env=environment(), cwd=ROOT, **pipes)
    with process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "ready\n"
        yield Server(process)
        process.stdin.close()


def accounted(
    family: str, name: str, expected: Mapping[str, Sequence[int]], *arguments: object, server: Any
) -> Figures:
    """Run a side against a server of its own, which has to have run each goal once, and in order.

    Raises Lost where it has not.
    """
    for tries in range(1, LOST + 1):
        with serving(*server) as running:
            try:
                figures = side(family, name, *arguments)
            except Lost as error:
                if tries == LOST:
                    raise
                print(f"again: {error}", file=sys.stderr)
                continue
            ran = running.journal()
        if ran != {action: [*orders] for action, orders in expected.items()}:
            raise Lost(f"{family} {name}: the server ran {ran}, not {expected}")
        return figures
    raise AssertionError
