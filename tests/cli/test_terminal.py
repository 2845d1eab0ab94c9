"""`bt-actions run` in a pseudo-terminal that an emulator reads and the test types into."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import sys
import termios
import time
from collections.abc import Callable, Iterator

import pyte
import pytest

from bt_actions.cli.driving.signals import SAME_WISH
from bt_actions.cli.views.live import SCROLLS
from tests.cli.conftest import marked
from tests.support.processes import PATIENCE, ROOT

ROWS, COLUMNS = 30, 100


class Terminal:
    """A program on a pseudo-terminal of its own, in a session of its own."""

    def __init__(self, *arguments: str, **environment: str) -> None:
        self.screen = pyte.HistoryScreen(COLUMNS, ROWS, history=1000)
        self._stream = pyte.ByteStream(self.screen)
        self.raw = b""
        self.most_below = 0
        self.code: int | None = None
        self.pid, self._end = pty.fork()
        if self.pid == 0:
            os.chdir(ROOT)
            command = [sys.executable, "-m", "bt_actions.cli", *arguments]
            os.environ.pop("COLUMNS", None)  # of the terminal in which the tests run
            own = {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT), **environment}
            os.execve(sys.executable, command, {**os.environ, **own})
        fcntl.ioctl(self._end, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))

    def read(self, within: float) -> bool:
        """Take in what is written; False when it has ended or nothing came in time."""
        ready, _, _ = select.select([self._end], [], [], within)
        if not ready:
            return False
        try:
            data = os.read(self._end, 65536)
        except OSError:
            data = b""
        self.raw += data
        self._stream.feed(data)
        return bool(data)

    @property
    def lines(self) -> list[str]:
        """What stands on the screen, and what has scrolled off it."""
        above = ["".join(line[x].data for x in range(COLUMNS)) for line in self.screen.history.top]
        return [line.rstrip() for line in [*above, *self.screen.display]]

    def until(self, wanted: str) -> None:
        """Wait until `wanted` stands on the screen."""
        deadline = time.monotonic() + PATIENCE
        while not any(wanted in line for line in self.lines):
            if not self.read(max(0.0, deadline - time.monotonic())):
                raise AssertionError(f"no {wanted!r} on the screen:\n" + "\n".join(self.lines))

    def type(self, keys: bytes) -> None:
        """Type, as a user does."""
        os.write(self._end, keys)

    def wait(self) -> int:
        """Read to the end; return the exit code."""
        deadline = time.monotonic() + PATIENCE
        while self.read(max(0.0, deadline - time.monotonic())):
            continue
        _, status = os.waitpid(self.pid, 0)
        self.code = os.waitstatus_to_exitcode(status)
        return self.code

    def close(self) -> None:
        """End it by force where it has not ended."""
        if self.code is None:
            os.kill(self.pid, 9)
            os.waitpid(self.pid, 0)
        os.close(self._end)


@pytest.fixture
def terminal(domain: int) -> Iterator[Callable[..., Terminal]]:
    terminals: list[Terminal] = []

    def start(*arguments: str, **environment: str) -> Terminal:
        terminals.append(Terminal(*arguments, **environment))
        return terminals[-1]

    yield start
    for each in terminals:
        each.close()


DEMO = ("run", "pick_and_place", "--sim", "--speed", "10")


def test_the_tree_is_drawn_live_and_leaves_the_report(
    terminal: Callable[..., Terminal], mark: str
) -> None:
    demo = terminal(*DEMO)
    demo.until("▶ To the part  executing, ")
    demo.until(" s left (timeout.feedback): current_pose")
    drawn = [line for line in demo.screen.display if line.strip()]
    start = next(n for n, line in enumerate(drawn) if "Ctrl-C cancels" in line)
    assert len(drawn) - start <= ROWS - 1 - SCROLLS
    assert demo.wait() == 0
    lines = [line for line in demo.lines if line]
    assert sum(line.startswith("✓ To the part") for line in lines) == 1
    assert not any("Ctrl-C" in line for line in lines)
    assert lines[-2:-1] == ["The part lies at 4.99 m, at the shelf."]
    assert lines[-1].startswith("SUCCESS after")
    assert marked(mark) == []


def test_ctrl_c_typed_into_the_terminal_cancels(terminal: Callable[..., Terminal]) -> None:
    demo = terminal("run", "pick_and_place", "--sim", "--fault", "move_robot:1:slow=100")
    demo.until("▶ To the part  executing")
    demo.type(b"\x03")
    assert demo.wait() == 130
    assert any(line.startswith("To the part") and "CANCELED" in line for line in demo.lines)
    assert any("interrupted by SIGINT: canceling 1 goal" in line for line in demo.lines)
    assert b"Traceback" not in demo.raw
    report = demo.raw.rpartition(b"interrupted by SIGINT\x1b[0m")[2]
    assert b"stopped while it ran:" in report, "the report comes last"
    assert b"executing" not in report
    assert b"\x1b[?25h" in demo.raw[demo.raw.rindex(b"\x1b[?25l") :], "the cursor is back"


def test_an_impatient_user_gets_the_report_and_a_usable_terminal(
    terminal: Callable[..., Terminal], mark: str
) -> None:
    demo = terminal("run", "pick_and_place", "--sim", "--fault", "move_robot:1:drop_cancel")
    demo.until("▶ To the part  executing")
    demo.type(b"\x03")
    demo.until("Ctrl-C again leaves")
    patient = time.monotonic() + 1.5 * SAME_WISH  # a second one sooner than that is the first
    while time.monotonic() < patient:
        demo.read(0.05)
    demo.type(b"\x03")  # once: the terminal throws away what it has not shown at each
    assert demo.wait() == 3
    said = "\n".join(demo.lines)
    assert "not accounted for: To the part on /move_robot" in said, said
    assert "CANCELED, end UNKNOWN" in said, said
    assert b"\x1b[?25h" in demo.raw[demo.raw.rindex(b"\x1b[?25l") :], "the cursor is back"
    assert marked(mark) == []


def test_what_libraries_write_to_standard_error_scrolls_by_above_the_drawing(
    terminal: Callable[..., Terminal],
) -> None:
    demo = terminal(*DEMO, "--fault", "move_robot:1:abort")
    assert demo.wait() == 0
    lines = demo.lines
    notes = [n for n, line in enumerate(lines) if "goal 1 meets abort" in line]
    assert len(notes) == 1
    assert lines[notes[0]].startswith("[INFO]")
    assert notes[0] < next(n for n, line in enumerate(lines) if line.startswith("✓ To the part"))


def test_a_closed_terminal_is_a_hangup(terminal: Callable[..., Terminal], mark: str) -> None:
    demo = terminal("run", "pick_and_place", "--sim", "--fault", "move_robot:1:slow=100")
    demo.until("▶ To the part  executing")
    os.close(demo._end)
    _, status = os.waitpid(demo.pid, 0)
    demo.code = os.waitstatus_to_exitcode(status)
    demo._end = os.open(os.devnull, os.O_RDONLY)
    assert demo.code == 129
    assert marked(mark) == []


@pytest.mark.parametrize(("option", "name"), [((), "dumb"), (("--plain",), "xterm-256color")])
def test_a_dumb_terminal_gets_lines_and_so_does_who_wants_it_plain(
    option: tuple[str, ...], name: str, terminal: Callable[..., Terminal]
) -> None:
    demo = terminal(*DEMO, *option, TERM=name)
    assert demo.wait() == 0
    assert b"\x1b" not in demo.raw
    assert any("RUNNING  Deliver the part" in line for line in demo.lines)


def test_a_latin_1_terminal_gets_no_character_that_it_does_not_have_and_no_color_is_respected(
    terminal: Callable[..., Terminal],
) -> None:
    demo = terminal(*DEMO, PYTHONIOENCODING="latin-1", PYTHONUTF8="0", NO_COLOR="1")
    assert demo.wait() == 0
    colours = [f"\x1b[{code}m".encode() for code in (31, 32, 33, 36)]
    assert not any(colour in demo.raw for colour in colours)
    assert demo.raw.isascii()
    assert any(line.startswith("+ To the part") for line in demo.lines)
