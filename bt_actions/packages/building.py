"""The whole way, from folders to wheels: read, ordered, generated, packed."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from bt_actions.packages.environment import Tools
from bt_actions.packages.generation import Progress, generate
from bt_actions.packages.sources import Package
from bt_actions.packages.wheel import pack


def build_wheels(
    sources: Iterable[Package],
    tools: Tools,
    prefixes: Sequence[Path],
    out: Path,
    progress: Progress,
) -> list[Path]:
    """Build `sources`, which are in order, upon `prefixes`; write their wheels into `out`.

    Raises PackageError at the first that cannot be built; wheels before it have been written.
    """
    sources = list(sources)
    built: list[Path] = []
    wheels = []
    with tempfile.TemporaryDirectory(prefix="bt_actions-build-") as folder:
        for source in sources:
            work = Path(folder) / source.name
            prefix = generate(source, [*built, *prefixes], tools, work, progress)
            progress(f"{source.name}: packing", "")
            wheels.append(pack(source, prefix, tools, sources, work, out))
            built.append(prefix)
    return wheels
