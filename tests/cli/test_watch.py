"""`bt-actions watch`: what it tells of the runs of a user, as lines and in a terminal."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable

import pytest

from tests.cli.conftest import Start
from tests.recording.test_watching import RUNS, fails
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.recordings import Going, record
from tests.support.terminal import Terminal


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_lines_tell_each_change_until_a_signal_ends_it(
    start: Start, number: signal.Signals, code: int
) -> None:
    run = Going(RUNS)
    try:
        run.write(RUNS)
        watch = start("watch")
        assert watch.line().endswith(f"  all  {RUN_ID[:8]} in sim  goes on")
        assert watch.line().endswith(f"  all  {RUN_ID[:8]}  Move: sending a goal to /move")
        run.write(fails(RUNS))
        assert f"  all  {RUN_ID[:8]} in sim  FAILURE after" in watch.line()
        assert "R\u00f8t / Move" in watch.line()
        assert "no room" in watch.line()
    finally:
        run.end()
    watch.popen.send_signal(number)
    assert watch.popen.wait(20.0) == code


def test_where_nothing_runs_the_last_run_is_told_and_the_next_one_is_awaited(start: Start) -> None:
    record(every_kind())
    watch = start("watch", "all")
    said = watch.line()
    assert said.startswith(f"no run goes on; the last: all  {RUN_ID[:8]}  ")
    assert "STOPPED" in said
    other = start("watch", "elsewhere")
    assert other.line() == "no run goes on; and no run of elsewhere is recorded"
    for each in (watch, other):
        each.popen.send_signal(signal.SIGINT)
        assert each.popen.wait(20.0) == 130


def test_it_ends_when_nobody_reads_any_more() -> None:
    record(every_kind())
    watch = subprocess.Popen(
        [sys.executable, "-m", "bt_actions.cli", "watch"], stdout=subprocess.PIPE, text=True
    )
    assert watch.stdout is not None
    assert watch.stdout.readline()
    watch.stdout.close()
    assert watch.wait(20.0) == 141


def test_a_terminal_shows_what_runs_and_above_it_what_has_ended(
    terminal: Callable[..., Terminal],
) -> None:
    run = Going(RUNS)
    try:
        run.write(RUNS)
        shown = terminal("watch", RUN_ID[:4])
        shown.until(f"\u25b6 all  {RUN_ID[:8]} in sim  goes on")
        shown.until("sending a goal to /move")
        run.write(fails(RUNS))
        shown.until(f"\u2717 all  {RUN_ID[:8]} in sim  FAILURE after")
        shown.until("no room")
        shown.until("no run goes on")
    finally:
        run.end()
    shown.type(b"\x03")
    assert shown.wait() == 130
    assert not any("Ctrl-C ends" in line for line in shown.lines)
