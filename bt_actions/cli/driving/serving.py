"""A server on a node of its own, from its start to its end by a signal or a dead executor.

The order of the end: the server answers its clients and closes, the executor stops, then node and
context go. Knows nothing of the server's purpose.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from bt_actions.cli.driving.signals import Signals
from bt_actions.cli.exits import Exit, importing_ros, starting_ros
from bt_actions.cli.streams.writing import note
from bt_actions.utilities.plain_text import raised
from bt_actions.utilities.shorten import fit


class Served(Protocol):
    """A server."""

    def close(self) -> None:
        """Close, while the executor spins the node."""


AnyServed = TypeVar("AnyServed", bound=Served)


def serve(
    command: str,
    make: Callable[[Any], AnyServed],
    *,
    announce: Callable[[AnyServed], None],
    close: Callable[[AnyServed, Signals], None] = lambda server, _: server.close(),
    conclude: Callable[[AnyServed, Exit], Exit],
    name: str,
    namespace: str = "",
    executor: str | None = None,
) -> Exit:
    """Serve what `make` makes of a node called `name`; return the exit code. Main thread only.

    `announce` and `close` are called while the node spins. `conclude` is called at the end with
    the exit code so far, and returns the final one.
    """
    with importing_ros():
        from bt_actions.ros.spinning import Spinner

    with Signals() as signals:
        with starting_ros():
            spinner = Spinner(None, executor, name=name, namespace=namespace, died=signals.poke)
        server = None
        try:
            server = make(spinner.node)
            spinner.start()
            announce(server)
            while spinner.error is None and not signals.wait(None)[0]:
                pass
        finally:
            if server is not None:
                close(server, signals)
            spinner.stop(signals.poke, None)
        code = conclude(server, Exit.FAILURE if spinner.error else Exit.SUCCESS)
        if spinner.error:
            note(f"bt-actions {command}: the executor died: {raised(spinner.error)}")
        signals.settle(code)
    return code


def say(text: str) -> None:
    """Print a line at once, with or without a reader."""
    with contextlib.suppress(OSError, ValueError):
        print(fit(text), flush=True)
