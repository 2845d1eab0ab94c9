"""`bt-actions` with every event of the run written to a file as well: ``FILE ARGUMENT...``.

What is shown is what any user sees; the file is what the view was told.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from bt_actions.cli.driving.feed import Feed
from bt_actions.cli.program import main
from bt_actions.events import Event, to_line


def record(path: Path) -> None:
    """Have the events of each run written to `path`, a line each."""
    take, file = Feed.event, path.open("w", encoding="ascii", buffering=1)

    def event(self: Feed, event: Event) -> None:
        file.write(f"{to_line(event)}\n")
        take(self, event)

    Feed.event = event  # type: ignore[method-assign]


def replay(path: Path, view: Any, state: Any) -> None:
    """Show the run in a file in a view that was made for `state`."""
    from bt_actions.events import from_line

    feed = Feed(state, view)
    for line in path.read_text(encoding="ascii").splitlines():
        feed.event(from_line(line))
    view.finish()


if __name__ == "__main__":
    record(Path(sys.argv[1]))
    sys.exit(main(sys.argv[2:]))
