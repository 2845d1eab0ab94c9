"""The tree, drawn live at the bottom of a terminal, in all of its height but some lines.

Finished work scrolls by once above the drawing. The main thread draws, about ten times a second.
Lines of C libraries on standard error are caught and scroll by, too: the drawing would hide them.
"""

from __future__ import annotations

from py_trees.common import Status
from rich.console import Console
from rich.live import Live
from rich.text import Text

from bt_actions.cli.streams.stderr import CaughtStderr
from bt_actions.cli.views.choosing import choose
from bt_actions.cli.views.view import View
from bt_actions.events import Event, NodeChanged, RoundBegan, RunBegan, TickLasts
from bt_actions.events.kinds import NodesAdded, NodesRemoved
from bt_actions.story.doing import doing
from bt_actions.story.state import OVER, NodeStory, State
from bt_actions.story.words import goal_text, judged, last_words
from bt_actions.utilities.plain_text import clean

_STYLES = {
    Status.SUCCESS: "green",
    Status.FAILURE: "red",
    Status.RUNNING: "bold cyan",
    Status.INVALID: "dim",
}
_GLYPHS = {
    Status.SUCCESS: ("✓", "+"),
    Status.FAILURE: ("✗", "x"),
    Status.RUNNING: ("▶", ">"),
    Status.INVALID: ("·", "."),
}

SCROLLS = 8
"""Lines above the drawing for scrolling text; of a low terminal, two thirds."""
NARROW = 60
"""Columns below which levels are indented by one space instead of two."""
BAR = 20
"""Columns of the progress bar where there is room."""


def joined(lines: list[Text], console: Console) -> Text:
    """Return a picture of lines, each cut to the width of a terminal."""
    for line in lines:
        line.no_wrap = True
        cut(line, console, max(1, console.width - 1))
    return Text("\n").join(lines)


def cut(text: Text, console: Console, width: int) -> None:
    """Cut `text` to a width, with an ellipsis at its end."""
    if text.cell_len > width:
        dots = "..." if console.options.ascii_only else "…"
        text.truncate(max(0, width - len(dots)), overflow="crop")
        text.append(dots[:width])


def drawing(console: Console, *, whole: bool = False) -> Live:
    """Begin a drawing at the bottom of a terminal; `whole` takes all of the terminal."""
    live = Live(
        console=console,
        auto_refresh=False,
        screen=whole,
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
        vertical_overflow="crop",
    )
    live.start()
    return live


class LiveView(View):
    """A drawing of the state; without `finish` the terminal keeps the drawing."""

    def __init__(self, state: State, console: Console, *, whole: bool = False) -> None:
        """Take a console; with `whole` the whole terminal, whose former content comes back."""
        self._state = state
        self._console = console
        self._plain = console.options.ascii_only
        self._nodes: list[int] = []
        self._position: dict[int, int] = {}
        self._leaves = 0
        self._running: set[int] = set()
        self._done: set[int] = set()
        self._last: dict[int, Status] = {}
        self._passing: list[Text] = []
        self._stderr = CaughtStderr()
        self._live = drawing(console, whole=whole)

    @property
    def fileno(self) -> int:
        """The descriptor of standard error's lines, to wait for beside events."""
        return self._stderr.fileno

    def event(self, event: Event) -> None:
        """Take in one event; let finished work scroll by."""
        match event:
            case RunBegan() | NodesAdded() | NodesRemoved():
                self._index()
            case NodeChanged():
                self._node_changed(event)
            case TickLasts(is_over=False):
                self._running.add(event.node)
            case RoundBegan():
                for node in self._state.below(event.node):
                    self._last.pop(node, None)
                    self._done.discard(node)

    def _node_changed(self, event: NodeChanged) -> None:
        story, status = self._state.nodes[event.node], event.status
        (self._running.add if status is Status.RUNNING else self._running.discard)(event.node)
        if not story.is_leaf:
            if status is not Status.INVALID:  # the node may have begun anew
                below = self._done.intersection(self._state.below(event.node))
                self._done -= {each for each in below if not self._state.is_begun(each)}
            return
        if status in OVER:
            self._done.add(event.node)
            if story.node.server or self._last.get(event.node) is not status:
                self._passing.append(self._finished(story))
            self._last[event.node] = status
        else:
            self._done.discard(event.node)

    def frame(self, now: float) -> None:
        """Draw the state."""
        self._let_by()
        height = self._console.height - 1
        lines = self._lines(now, max(1, height // 3, height - SCROLLS))
        self._live.update(joined(lines, self._console), refresh=True)

    def say(self, text: str) -> None:
        """Let `text` scroll by."""
        self._passing.append(Text(text, style="yellow"))

    def finish(self) -> None:
        """Take the drawing away; write the table of actions and the summary."""
        self.close()
        state = self._state
        caused = state.ended is not None and bool(state.ended.cause)
        colour = "yellow" if caused else _STYLES[judged(state)]
        for line in last_words(state, self._console.width):
            ending = line.startswith(("SUCCESS after", "FAILURE after", "STOPPED after"))
            style = f"bold {colour}" if ending else ""
            self._console.print(Text(line, style=style), soft_wrap=True)

    def close(self) -> None:
        """Take the drawing away and give standard error back."""
        if self._live.is_started:
            self._live.update(Text(""), refresh=True)
            self._live.stop()
        self._stderr.close()
        self._let_by()

    def _index(self) -> None:
        self._nodes = self._state.in_order()
        self._position = {node: number for number, node in enumerate(self._nodes)}
        self._leaves = sum(self._state.nodes[node].is_leaf for node in self._nodes)
        self._done &= self._position.keys()

    def _let_by(self) -> None:
        """Let the gathered lines scroll by in one go: each print draws the rest anew."""
        self._passing += [Text(line, style="dim") for line in self._stderr.lines()]
        if self._passing:
            lines, self._passing = self._passing, []
            self._console.print(Text("\n").join(lines), soft_wrap=True)

    def _finished(self, story: NodeStory) -> Text:
        name, said = clean(self._state.called(story.node.id)), clean(story.message)
        if story.node.server and not story.is_left_out:
            action = self._state.action(story.node.id)
            said = f"{action.server}  {clean(goal_text(action))}  {action.lately:.2f} s"
        status = Status.INVALID if story.is_left_out else story.status
        glyph = self._glyph(status), _STYLES[status]
        return Text.assemble(glyph, " ", name, (f"  {said}" if said else "", "dim"))

    def _lines(self, now: float, most: int) -> list[Text]:
        """Return the progress line, and as many nodes as there is room for: `most` lines in all."""
        lines = [self._progress(now)]
        running = [node for node in self._running if node in self._position]
        tree = self._state, self._nodes, self._position
        shown, hidden, forks = choose(*tree, running, max(0, most - 1))
        above: list[int] = []
        for node in shown:
            holders = {each.node.id for each in self._state.above(node)}
            while above and above[-1] not in holders:
                above.pop()
            mark = self._state.nodes[forks[node]].node.name if node in forks else ""
            lines.append(self._node(now, node, len(above), mark))
            above.append(node)
        if hidden and most > 1:
            dots = "..." if self._plain else "…"
            more = f"{dots} {hidden} more node{'s' if hidden > 1 else ''}"
            lines.append(Text(more, style="dim"))
        return lines

    @property
    def _width(self) -> int:
        return max(1, self._console.width - 1)

    def _node(self, now: float, node: int, depth: int, mark: str) -> Text:
        story = self._state.nodes[node]
        status = Status.RUNNING if node in self._running else Status.INVALID
        if status is Status.INVALID and self._state.is_begun(node):
            status = story.status
        narrow = self._width < NARROW
        text = Text((" " if narrow else "  ") * depth)
        text.append(f"{self._glyph(status)} ", style=_STYLES[status])
        for name in filter(None, (mark, story.node.name)):
            said = Text(clean(name), style="dim" if status is Status.INVALID else "")
            cut(said, self._console, max(12, self._width // (4 if mark else 2)))
            text.append_text(said)
            text.append(": " if name is mark else "")
        if status is Status.RUNNING:
            does = doing(self._state, story, now)._replace(where="", since="")
            if narrow and does.until:
                does = does._replace(what="")
            told = clean(str(does))
            text.append(f"  {told}" if told else "", style="cyan")
        return text

    def _progress(self, now: float) -> Text:
        done, leaves = len(self._done), max(1, self._leaves)
        elapsed = f"  {self._state.since_began(now):.1f} s"
        keys = f"  Ctrl-C {'cancels' if self._state.stop is None else 'again leaves'}"
        counts = (f" {done} of {self._leaves} leaves", f" {done}/{self._leaves}", "")
        count = next(c for c in counts if not c or len(c + elapsed + keys) <= self._width)
        width = max(0, min(BAR, self._width - len(count + elapsed + keys)))
        bar = self._bar(width, min(done, leaves) / leaves)
        return bar.append(count if width else count.lstrip()).append(elapsed + keys, "dim")

    def _bar(self, width: int, share: float) -> Text:
        """Return a bar of some columns, of which a share is full."""
        full, empty = ("=", "-") if self._plain else ("━", "─")
        filled = int(width * share)
        return Text.assemble((full * filled, "green"), (empty * (width - filled), "dim"))

    def _glyph(self, status: Status) -> str:
        return _GLYPHS[status][self._plain]
