"""Standard output and standard error for a process that has them closed (`>&-`): the null device.

py_trees cannot be imported without `sys.stdout`, and the next socket would get a closed descriptor,
to be printed on. Imports nothing of this package: this module comes first.
"""

from __future__ import annotations

import os
import sys


def open_closed_streams() -> None:
    """Open the null device in place of each standard stream that is closed."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is not None:
            continue
        nowhere = os.open(os.devnull, os.O_WRONLY)
        if nowhere != number:
            os.dup2(nowhere, number)
            os.close(nowhere)
        setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", errors="replace"))
