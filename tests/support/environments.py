"""A copy of this environment, in which a test can install packages."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

HIDDEN = ("LD_LIBRARY_PATH", "PYTHONPATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
"""Variables that lead back to the environment of the test itself."""


def copy_environment(prefix: Path) -> None:
    """Make the copy, of links where that is possible."""

    def link(source: str, target: str) -> None:
        try:
            os.link(source, target)
        except OSError:
            shutil.copy2(source, target)

    shutil.copytree(sys.prefix, prefix, symlinks=True, copy_function=link)


def own_commands(prefix: Path, *names: str) -> None:
    """Let commands of a copy use the copy's Python."""
    for name in names:
        command = prefix / "bin" / name
        text = command.read_text().replace(sys.prefix, str(prefix))
        command.unlink()  # and leave the file that it is a link to
        command.write_text(text)
        command.chmod(0o755)
