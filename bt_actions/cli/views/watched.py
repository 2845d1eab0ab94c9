"""All runs of a user at once: drawn anew in a terminal, or a line for each change.

The end of a run scrolls by once, with the cause of a failure.
"""

from __future__ import annotations

import time
from collections.abc import Iterable

from rich.console import Console
from rich.text import Text

from bt_actions.cli.streams.writing import write
from bt_actions.cli.views.live import drawing, joined
from bt_actions.recording.watching import Seen
from bt_actions.story.doing import doing
from bt_actions.utilities.plain_text import clean

_LOOKS = {
    "running": ("▶", ">", "bold cyan"),
    "waiting": ("▶", ">", "yellow"),
    "success": ("✓", "+", "green"),
    "failure": ("✗", "x", "red"),
    "stopped": ("·", ".", "yellow"),
    "lost": ("?", "?", "bold red"),
}
NOTHING = "no run goes on"


def title(seen: Seen) -> str:
    """Return the name of a run, and its state."""
    where = " in sim" if seen.summary.is_simulated else ""
    return f"{seen.summary.tree}  {seen.summary.run_id[:8]}{where}  {seen.word}"


class WatchedLines:
    """A line for each change, with the time of the day before it."""

    def __init__(self) -> None:
        self._told: dict[str, tuple[str, ...]] = {}

    def show(self, runs: Iterable[Seen]) -> None:
        """Write the changes since the last call. Raises OutputLost or BrokenPipeError."""
        for seen in runs:
            key, words = seen.summary.run_id, _lasting(seen)
            before = self._told.get(key, ("",))
            self._told[key] = words
            if words[0] != before[0]:
                self._say(title(seen))
            if seen.is_over and words != before:
                write("".join(f"    {line}\n" for line in seen.why))
            elif not seen.is_over:
                for line in words[1:]:
                    if line not in before[1:]:
                        self._say(f"{seen.summary.tree}  {key[:8]}  {line}")

    def close(self) -> None:
        """Do nothing: lines leave nothing behind."""

    def _say(self, text: str) -> None:
        write(f"{time.strftime('%H:%M:%S')}  {text}\n")


def _lasting(seen: Seen) -> tuple[str, ...]:
    """Return the words about a run, without those that change all the time; its state first."""
    word = seen.look if seen.look == "lost" or seen.word.startswith("Stale") else seen.word
    does = []
    for each in () if seen.is_over else seen.state.running:
        said = doing(seen.state, each)._replace(told="", until="")
        name = seen.state.called(each.node.id)
        does.append(clean(f"{name}: {said}" if str(said) else f"{name} runs"))
    return word, *does


class WatchedScreen:
    """The runs that go on, at the bottom of a terminal; above them the ended ones."""

    def __init__(self, console: Console, last: str) -> None:
        """Take a console; `last` tells the end of the last run while no run goes on."""
        self._console, self._last = console, last
        self._is_plain = console.options.ascii_only
        self._ended: set[str] = set()
        self._live = drawing(console)

    def show(self, runs: list[Seen]) -> None:
        """Draw the states of the runs; let ended runs scroll by."""
        for seen in runs:
            if seen.is_over and seen.summary.run_id not in self._ended:
                self._ended.add(seen.summary.run_id)
                self._last = ""
                for line in self._lines(seen):
                    self._console.print(line, soft_wrap=True)
        going = [each for each in runs if not each.is_over or each.look == "lost"]
        lines = [line for seen in going for line in self._lines(seen)]
        if not lines:
            lines = [Text(NOTHING, style="dim"), *([Text(self._last)] if self._last else [])]
        room = max(1, self._console.height - 2)
        if len(lines) > room:
            more = f"{len(lines) - room + 1} more lines"
            lines = [*lines[: room - 1], Text(more, style="dim")]
        lines.append(Text("Ctrl-C ends", style="dim"))
        self._live.update(joined(lines, self._console), refresh=True)

    def close(self) -> None:
        """Take the drawing away."""
        self._live.stop()

    def _lines(self, seen: Seen) -> list[Text]:
        glyph, plain, style = _LOOKS[seen.look]
        lasts = "" if seen.is_over else f"  {seen.seconds:.1f} s"
        head = Text.assemble((plain if self._is_plain else glyph, style), f" {title(seen)}{lasts}")
        return [head, *(Text(f"    {line}") for line in seen.why)]
