"""A recording in the whole of a terminal: recent ends, the tree, and the player's line.

A frame depends on the state alone, not on the player's way to its moment. At the end the former
content of the terminal comes back.
"""

from __future__ import annotations

from itertools import islice

from py_trees.common import Status
from rich.console import Console
from rich.text import Text

from bt_actions.cli.driving.player import Player
from bt_actions.cli.views.live import BAR, SCROLLS, LiveView, joined
from bt_actions.story.state import OVER, State
from bt_actions.story.words import last_words


class PlayedView(LiveView):
    """A drawing of a player's moment."""

    def __init__(self, console: Console) -> None:
        super().__init__(State(), console, whole=True)
        self._drawn = Text()

    def show(self, player: Player) -> None:
        """Draw, where the picture changes."""
        state = self._state = player.state
        self._index()
        self._running = {key for key, each in state.nodes.items() if each.status is Status.RUNNING}
        if state.lasting is not None:
            self._running.add(state.lasting.node)
        leaves = [each for each in state.nodes.values() if each.is_leaf and each.status in OVER]
        room = self._console.height - 1
        if state.ended is not None:
            words = last_words(state, self._width)
            above = [part for each in words for part in Text(each).wrap(self._console, self._width)]
        else:
            leaves.sort(key=lambda each: -each.number)
            above = [self._finished(each) for each in islice(leaves, room)][::-1]
        most = max(0, room - (min(len(above), SCROLLS) if state.ended is None else len(above)))
        tree = self._lines(player.now, most + 1)[1:] if most else []
        above = above[max(0, len(above) + len(tree) - room) :]
        blank = [Text()] * (room - len(above) - len(tree))
        picture = joined([*blank, *above, *tree, self._line_of(player)], self._console)
        if picture != self._drawn:
            self._drawn = picture
            self._live.update(picture, refresh=True)

    def _line_of(self, player: Player) -> Text:
        """Return the player's moment, its speed, and as many of its keys as there is room for."""
        length = player.last - player.first
        share = (player.now - player.first) / length if length > 0.0 else 1.0
        across, along, times = ("left/right", "up/down", "x") if self._plain else ("←→", "↑↓", "×")
        position = f" {_clock(player.now - player.first)} of {_clock(length)}"
        speed = f"  {times}{player.speed:g}"
        said = player.said or (player.is_paused and "paused") or ""
        said = said and f"  {said}"
        long = f"space  {across} 5 s  {along} 1 min  ,. event  n failure  +- speed  q ends"
        short = f"space {across} {along} ,. n +- q"
        left = self._width - len(position + speed + said)
        keys = next((f"  {each}" for each in (long, short) if len(each) + 2 <= left), "")
        width = max(0, min(BAR, left - len(keys)))
        text = self._bar(width, share).append(position if width else position.lstrip())
        return text.append(speed, "bold").append(said, "yellow").append(keys, "dim")


def _clock(seconds: float) -> str:
    """Return seconds as players show them: ``1:02:03.4``, without hours where there are none."""
    minutes, rest = divmod(round(seconds, 1), 60.0)
    hours, minutes = divmod(minutes, 60.0)
    return f"{hours:.0f}:{minutes:02.0f}:{rest:04.1f}" if hours else f"{minutes:.0f}:{rest:04.1f}"
