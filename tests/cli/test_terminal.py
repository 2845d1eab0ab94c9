"""`bt-actions run` in a pseudo-terminal that an emulator reads and the test types into."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pytest

from bt_actions.cli.driving.signals import SAME_WISH
from bt_actions.cli.views.live import SCROLLS
from tests.cli.conftest import marked
from tests.support.terminal import ROWS, Terminal

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
