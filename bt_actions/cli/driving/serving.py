"""A server on a node of its own, from its start to its end: until a signal, or its executor dies.

The order of the end: who is served is answered (drain), nothing spins any more, the server goes,
then node and context. Knows nothing of what is served.
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


class Server(Protocol):
    """What is served."""

    def close(self) -> None:
        """Be gone; nothing spins its node any more."""


AnyServer = TypeVar("AnyServer", bound=Server)


def serve(
    command: str,
    make: Callable[[Any], AnyServer],
    *,
    announce: Callable[[AnyServer], None],
    drain: Callable[[AnyServer, Signals], None] = lambda server, signals: None,
    conclude: Callable[[AnyServer, Exit], Exit],
    name: str,
    namespace: str = "",
    executor: str | None = None,
) -> Exit:
    """Serve what `make` makes of a node called `name`; return the exit code. Main thread only.

    `announce` is called when the node is spun, `drain` while it still is, and `conclude` at the
    end, with the exit code so far; it returns what that is to be.
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
                drain(server, signals)
            spinner.stop(signals.poke, server.close if server is not None else None)
        code = conclude(server, Exit.FAILURE if spinner.error else Exit.SUCCESS)
        if spinner.error:
            note(f"bt-actions {command}: the executor died: {raised(spinner.error)}")
        signals.settle(code)
    return code


def say(text: str) -> None:
    """Print a line at once, whether or not anybody reads it."""
    with contextlib.suppress(OSError, ValueError):
        print(fit(text), flush=True)
