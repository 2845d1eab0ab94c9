"""This user's view: the token that opens it, and the one that is running, which others may use.

Both are files in the state directory of the user. A lock on the second one, which the kernel takes
back from a process that is killed, tells whether the view runs.
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
    """No view runs, and none could be started."""


def token() -> str:
    """Return the user's token, which is made at its first use. Raises OSError."""
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
    """Return what a user opens: the address with the token, and what is to be shown.

    Raises OSError where there is no token, nor can one be kept.
    """
    return f"{address}#token={token()}{shown and f'&{shown}'}"


def running() -> str:
    """Return where the view of this user is that runs; "" where none does."""
    path = home().parent / "view.address"
    return path.read_text() if is_written(path) else ""


@contextlib.contextmanager
def registered(place: str) -> Iterator[None]:
    """Have others use the view at `place` meanwhile, unless another one runs. Raises OSError."""
    path = _file("view.address")
    if is_written(path):
        yield
        return
    with locked(path, place.encode()):
        yield


def shown() -> str:
    """Return where this user's view is; start one where none runs, which ends when nobody looks.

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
    """Return the place of a file in a folder that is there, and the user's own."""
    folder = home().parent
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder / name
