"""The tree, drawn live at the bottom of a terminal, in all of its height but some lines.

Finished work scrolls by once above it. Drawn from the main thread, about ten times a second.
What the C libraries write to standard error meanwhile is caught and scrolls by too, or it would
be drawn over.
"""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from rich.console import Console
from rich.live import Live
from rich.text import Text

from bt_actions import render
from bt_actions.cli.streams.stderr import CaughtStderr
from bt_actions.cli.views.choosing import branches, choose, fork_of, is_below
from bt_actions.cli.views.words import Closing, feedback_text, goal_text, last_words
from bt_actions.events import Event, NodeChanged
from bt_actions.running.report import Report, Row
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

_LEFT_FOR = {
    "queue": "for its turn",
    "server": "for the server",
    "accept": "for the answer",
    "result": "for the result",
    "feedback": "for feedback",
    "cancel": "for the cancel",
}


SCROLLS = 8
"""Lines above the drawing that stay for what scrolls by; of a low terminal, two thirds."""
NARROW = 60
"""Columns below which levels are indented by one space instead of two."""
BAR = 20
"""Columns of the progress bar where there is room."""


def suits(console: Console) -> bool:
    """Whether `console` is a terminal that can be drawn on."""
    return console.is_terminal and not console.is_dumb_terminal


class LiveView:
    """Draws from the report; `finish` must be called, or the terminal keeps the drawing."""

    def __init__(self, report: Report, console: Console) -> None:
        self._report = report
        self._console = console
        self._plain = not _can_write(console, "✓✗▶·…━")
        self._nodes: list[Behaviour] = []
        self._position: dict[object, int] = {}
        self._leaves = 0
        self._index()
        self._running: set[object] = set()
        self._done: set[object] = set()
        self._last: dict[object, Status] = {}
        self._stopping = False
        self._passing: list[Text] = []
        self._stderr = CaughtStderr()
        self._live = Live(
            console=console,
            auto_refresh=False,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
            vertical_overflow="crop",
        )
        self._live.start()

    @property
    def fileno(self) -> int:
        """What to wait for besides events: standard error's lines."""
        return self._stderr.fileno

    def event(self, event: Event) -> None:
        """Take in one event; let finished work scroll by."""
        if not isinstance(event, NodeChanged):
            return
        node = event.node
        if node.id not in self._position:
            self._index()  # a node that was added while the tree runs
        (self._running.add if event.status is Status.RUNNING else self._running.discard)(node.id)
        if node.children:
            return
        if event.status in (Status.SUCCESS, Status.FAILURE):
            self._done.add(node.id)
            if render.action_of(node) or self._last.get(node.id) is not event.status:
                self._passing.append(self._finished(node, event.status, event.message))
            self._last[node.id] = event.status
        else:
            self._done.discard(node.id)

    def frame(self) -> None:
        """Draw."""
        self._let_by()
        lines = self._lines()
        self._live.update(Text("\n").join(lines), refresh=True)

    def say(self, text: str) -> None:
        """Let `text` scroll by."""
        self._stopping = True
        self._passing.append(Text(text, style="yellow"))

    def finish(self, closing: Closing) -> None:
        """Take the drawing away; write the table of actions and the summary."""
        self.close()
        colour = _STYLES[self._report.status] if not closing.cause else "yellow"
        for line in last_words(self._report, closing, self._console.width):
            ending = line.startswith(("SUCCESS after", "FAILURE after", "STOPPED after"))
            self._console.print(
                Text(line, style=f"bold {colour}" if ending else ""), soft_wrap=True
            )

    def close(self) -> None:
        """Take the drawing away and give standard error back."""
        if self._live.is_started:
            self._live.update(Text(""), refresh=True)
            self._live.stop()
        self._stderr.close()
        self._let_by()

    def _index(self) -> None:
        self._nodes = [row.node for row in render.rows(self._report.root)]
        self._position = {node.id: number for number, node in enumerate(self._nodes)}
        self._leaves = sum(not node.children for node in self._nodes)

    def _let_by(self) -> None:
        """Let what has come together scroll by, in one go: each print draws the rest anew."""
        self._passing += [Text(line, style="dim") for line in self._stderr.lines()]
        if self._passing:
            lines, self._passing = self._passing, []
            self._console.print(Text("\n").join(lines), soft_wrap=True)

    def _finished(self, node: Behaviour, status: Status, message: str) -> Text:
        text = Text.assemble((self._glyph(status), _STYLES[status]), " ")
        text.append(clean(self._report.called(node)))
        action = render.action_of(node)
        if action is None:
            text.append(f"  {clean(message)}" if message else "", style="dim")
        else:
            row = self._report.row(node)
            text.append(f"  {row.server}  {clean(goal_text(row))}", style="dim")
            text.append(f"  {row.duration:.2f} s", style="dim")
        return text

    def _lines(self) -> list[Text]:
        """The progress line, and as many nodes as there is room for."""
        height = self._console.height - 1
        most = max(1, height // 3, height - SCROLLS)
        lines = [self._progress()]
        running = self._running_nodes()
        shown, hidden = choose(self._nodes, self._position, running, max(0, most - 1))
        marks = self._marks(shown, running)
        above: list[Behaviour] = []
        for node in shown:
            while above and not is_below(node, above[-1]):
                above.pop()
            lines.append(self._node(node, len(above), marks.get(node.id, "")))
            above.append(node)
        if hidden and most > 1:
            more = f"{self._dots} {hidden} more node{'s' if hidden > 1 else ''}"
            lines.append(Text(more, style="dim"))
        for line in lines:
            line.no_wrap = True
            self._fit(line, self._width)
        return lines

    def _marks(self, shown: list[Behaviour], running: list[Behaviour]) -> dict[object, str]:
        """What tells a running node apart where there was no room for what holds it."""
        there = {node.id for node in shown}
        forks = fork_of(branches(running, self._position))
        return {tip: fork.name for tip, fork in forks.items() if fork.id not in there}

    @property
    def _width(self) -> int:
        return max(1, self._console.width - 1)

    @property
    def _dots(self) -> str:
        return "..." if self._plain else "…"

    def _fit(self, text: Text, width: int) -> None:
        """Cut `text` where it is too long, with an ellipsis at its end."""
        if text.cell_len > width:
            text.truncate(max(0, width - len(self._dots)), overflow="crop")
            text.append(self._dots[:width])

    def _running_nodes(self) -> list[Behaviour]:
        return [self._nodes[self._position[key]] for key in self._running if key in self._position]

    def _node(self, node: Behaviour, depth: int, mark: str) -> Text:
        status = self._report.status_of(node)
        narrow = self._width < NARROW
        text = Text((" " if narrow else "  ") * depth)
        text.append(f"{self._glyph(status)} ", style=_STYLES[status])
        for name in filter(None, (mark, node.name)):
            said = Text(name, style="dim" if status is Status.INVALID else "")
            self._fit(said, max(12, self._width // (4 if mark else 2)))
            text.append_text(said)
            text.append(": " if name is mark else "")
        if status is Status.RUNNING and not node.children:
            row = self._report.row(node) if render.action_of(node) else None
            told = self._doing(row) if row else self._report.message_of(node)
            text.append(f"  {clean(told)}" if told else "", style="cyan")
        return text

    def _doing(self, row: Row) -> str:
        """What an action is doing: its state, the attempt, its feedback, and the time left."""
        progress = getattr(row.behaviour, "progress", None)
        if progress is None:
            return goal_text(row)
        now = progress()
        attempts = f"attempt {now.attempt} of {now.attempts}" if now.attempts > 1 else ""
        left = "" if now.seconds_left is None else _seconds(now.seconds_left)
        if now.deadline == "backoff":
            return ", ".join(
                part for part in (goal_text(row), f"again in {left}", attempts) if part
            )
        state = str(now.state).lower().replace("_", " ")
        deadline = f"{left} left {_LEFT_FOR.get(now.deadline, '')}".rstrip() if left else ""
        if self._width < NARROW and left:
            state, deadline = "", f"{left} left"
            attempts = f"{now.attempt} of {now.attempts}" if now.attempt > 1 else ""
        parts = (state, attempts, deadline, feedback_text(row))
        return ", ".join(part for part in parts if part)

    def _progress(self) -> Text:
        done, leaves = len(self._done), max(1, self._leaves)
        elapsed = f"  {self._report.elapsed():.1f} s"
        keys = f"  Ctrl-C {'again leaves' if self._stopping else 'cancels'}"
        counts = (f" {done} of {self._leaves} leaves", f" {done}/{self._leaves}", "")
        count = next(
            (c for c in counts if len(c + elapsed + keys) <= self._width or not c), counts[-1]
        )
        width = max(0, min(BAR, self._width - len(count + elapsed + keys)))
        filled = width * min(done, leaves) // leaves
        full, empty = ("=", "-") if self._plain else ("━", "─")
        text = Text()
        text.append(full * filled, style="green")
        text.append(empty * (width - filled), style="dim")
        text.append(count if width else count.lstrip())
        text.append(elapsed, style="dim")
        text.append(keys, style="dim")
        return text

    def _glyph(self, status: Status) -> str:
        return _GLYPHS[status][self._plain]


def _seconds(seconds: float) -> str:
    seconds = max(0.0, seconds)
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"


def _can_write(console: Console, text: str) -> bool:
    try:
        text.encode(console.encoding)
    except (UnicodeEncodeError, LookupError):
        return False
    return True
