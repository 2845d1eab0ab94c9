"""Files that are replaced as a whole: never half a file, and no temporary file left behind."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO


def replace_file(path: Path, data: bytes) -> None:
    """Write the new content of a file: all of it, or no change. Raises OSError.

    A link still leads to the file; its owner and permissions stay. A pipe or a device is written
    to.
    """
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    with replacing(path) as file:
        file.write(data)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Yield a file that takes the place of `path` at the end of the block, unless that raises.

    A link still leads to the file; its owner and permissions stay. Raises OSError.
    """
    before = path.stat() if path.exists() else None
    target = Path(os.path.realpath(path))
    new = target.with_name(f".{secrets.token_hex(8)}")  # nobody can have put a link there
    mode = 0o666 if before is None else 0o600
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as file:
        try:
            yield file
            file.flush()
            if before is not None:
                with contextlib.suppress(OSError):  # only root may give it away
                    os.fchown(descriptor, before.st_uid, before.st_gid)
                os.fchmod(descriptor, before.st_mode & 0o777)
            new.replace(target)
        except BaseException:
            new.unlink(missing_ok=True)
            raise
