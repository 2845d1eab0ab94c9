"""Files that are replaced as a whole: never half of one, and nothing left behind."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

__all__ = ["replace_file"]


def replace_file(path: Path, data: bytes) -> None:
    """Write what a file shall hold from now on: all of it, or no change. Raises OSError.

    A link still leads to it, and its permissions stay as they are. What exists and is no file, as a
    pipe or a device, is written to.
    """
    target = Path(os.path.realpath(path))
    before = target.stat() if target.exists() else None
    if before is not None and not target.is_file():
        target.write_bytes(data)
        return
    new = target.with_name(f".{secrets.token_hex(8)}")  # nobody can have put a link there
    mode = 0o666 if before is None else 0o600
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as file:
        try:
            file.write(data)
            file.flush()
            if before is not None:
                os.fchmod(file.fileno(), before.st_mode & 0o7777)
            new.replace(target)
        except BaseException:
            new.unlink(missing_ok=True)
            raise
