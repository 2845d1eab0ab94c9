"""The feed of the page's front: the state of all runs, each second, while a browser listens."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

from bt_actions.page.feed import message
from bt_actions.recording.watching import Seen, Watch

EACH = 1.0
"""Seconds between two messages: without one, a browser knows that the server is gone."""


async def standing(closing: Callable[[], bool]) -> AsyncIterator[bytes]:
    """Yield the states of the runs that go on, or have ended since."""
    with contextlib.closing(Watch()) as watch:
        while not closing():
            runs = await asyncio.to_thread(watch.look)
            yield message("now", {"runs": [_plain(each) for each in runs]})
            await asyncio.sleep(EACH)


def _plain(seen: Seen) -> dict[str, Any]:
    summary, state = seen.summary, seen.state
    return {
        "run_id": summary.run_id,
        "tree": summary.tree,
        "began": summary.began,
        "where": dict(summary.where),
        "word": seen.word,
        "look": seen.look,
        "seconds": seen.seconds,
        "over": seen.is_over,
        "recorded": state.began is not None,
        "why": list(seen.why),
        "running": 0 if seen.is_over else len(state.running),
        "dealt_with": state.dealt_with_in_all,
    }
