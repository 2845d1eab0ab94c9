"""This user's view: the token that opens it, and the running view, which other commands may use.

Both are files in the state directory of the user. A lock on the second file tells whether the view
runs: the kernel takes the lock back from a killed process.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from bt_actions.recording.folders import home, is_written, locked


class NoView(OSError):
    """No running view, and no way to start one."""


def token() -> str:
    """Return the user's token, made at its first use. Raises OSError."""
    path = _file("view.token")
    if not path.exists():
        new = path.with_name(f".{secrets.token_hex(8)}")
        with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(secrets.token_urlsafe(24))
        try:
            with contextlib.suppress(FileExistsError):  # another view was faster
                os.link(new, path)
        finally:
            new.unlink()
    return path.read_text().strip()


def opening(address: str, shown: str = "") -> str:
    """Return the address for the user to open, with the token and the thing to be shown.

    Raises OSError where no token can be read or kept.
    """
    return f"{address}#token={token()}{shown and f'&{shown}'}"


def running() -> str:
    """Return the address of this user's running view; "" for none."""
    path = home().parent / "view.address"
    return path.read_text() if is_written(path) else ""


@contextlib.contextmanager
def registered(place: str) -> Iterator[None]:
    """Offer the view at `place` to other commands, unless another one runs. Raises OSError."""
    path = _file("view.address")
    if is_written(path):
        yield
        return
    with locked(path, place.encode()):
        yield


def shown() -> str:
    """Return the address of this user's view; start one where none runs, which ends by itself.

    Raises NoView.
    """
    if place := running():
        return place
    started = subprocess.Popen(
        [sys.executable, "-P", "-m", "bt_actions.page"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        text=True,
    )
    assert started.stdout is not None
    with started.stdout:
        said = started.stdout.readline().strip()
    if not said.startswith("http"):
        raise NoView(said or "the process of the page has ended")
    return said


def _file(name: str) -> Path:
    """Return the path of a file in a folder of the user's own, which is made if needed."""
    folder = home().parent
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder / name
