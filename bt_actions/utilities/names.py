"""Names told apart by as little of their paths as possible."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


def told_apart(paths: Iterable[tuple[str, ...]]) -> dict[tuple[str, ...], str]:
    """Return for each path its name, with the shortest beginning that no other path shares."""
    texts: dict[tuple[str, ...], str] = {}
    left, size = set(paths), 1
    while left:
        ends = Counter(path[-size:] for path in left)
        done = {path for path in left if ends[path[-size:]] == 1 or size >= len(path)}
        texts |= {path: " / ".join(path[-size:]) for path in done}
        left, size = left - done, size + 1
    return texts
