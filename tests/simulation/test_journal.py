"""The journal: whole lines, whatever happens, and a reader that judges by them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bt_actions.simulation import journal
from bt_actions.simulation.journal import Event, Journal, JournalLine

S = "/move_robot"


def entry(t: float, goal: str, event: Event, *, server: str = S, pid: int = 1) -> JournalLine:
    return JournalLine(t, server, goal, event, pid)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    times = iter([1.0, 2.0])
    written = Journal(path, clock=lambda: next(times))
    written.write(S, "a1", Event.RECEIVED, number=1)
    written.write(S, "a1", Event.STEP, pose=1.5, reason='no "\n" way')
    lines = path.read_text().splitlines()
    assert len(lines) == 2, "a line is flushed as it is written"
    assert {"t", "server", "goal", "event"} <= json.loads(lines[0]).keys()
    written.close()
    first, second = journal.read(path)
    assert (first.t, first.server, first.goal, first.event) == (1.0, S, "a1", Event.RECEIVED)
    assert first.pid == os.getpid()
    assert first.more == {"number": 1}
    assert first.pose is None
    assert (second.pose, second.reason) == (1.5, 'no "\n" way')


def test_without_a_path_it_is_off() -> None:
    silent = Journal()
    assert not silent
    silent.write(S, "a1", Event.STEP)
    silent.close()


def test_it_goes_on_in_the_file_of_a_predecessor_and_a_torn_last_line_is_left_out(
    tmp_path: Path,
) -> None:
    path = tmp_path / "j.jsonl"
    for goal in ("a", "b"):
        Journal(path).write(S, goal, Event.RECEIVED)
    with path.open("a") as file:
        file.write('{"t": 2.0, "serv')
    assert [each.goal for each in journal.read(path)] == ["a", "b"]


def test_a_full_disk_is_told_once_and_stops_nothing() -> None:
    told: list[str] = []
    full = Journal("/dev/full", on_error=told.append)
    for _ in range(3):
        full.write(S, "a", Event.STEP)
    assert len(told) == 1
    assert "/dev/full" in told[0]


def test_a_file_that_cannot_be_opened_is_an_error_at_once(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        Journal(tmp_path / "nowhere" / "j.jsonl")


def test_a_process_that_is_killed_leaves_every_line_it_wrote(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    program = (
        "import os, signal, sys\n"
        "from bt_actions.simulation.journal import Event, Journal\n"
        "j = Journal(sys.argv[1])\n"
        "for n in range(1000): j.write('/s', str(n), Event.STEP)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    assert [each.goal for each in journal.read(path)] == [str(n) for n in range(1000)]


def test_a_goal_is_live_from_its_acceptance_to_its_end() -> None:
    entries = [
        entry(1, "a", Event.RECEIVED),
        entry(2, "a", Event.ACCEPTED),
        entry(3, "a", Event.CANCEL_REQUESTED),
        entry(4, "a", Event.CANCELED),
        entry(5, "b", Event.RECEIVED),
        entry(5, "b", Event.REJECTED),
        entry(6, "nobody's", Event.CANCEL_REQUESTED),
    ]
    [interval] = journal.live_intervals(entries)
    assert (interval.goal, interval.start, interval.end) == ("a", 2, 4)
    assert interval.how is Event.CANCELED
    assert journal.max_live(entries) == 1
    assert journal.ends(entries) == {(S, "a"): Event.CANCELED, (S, "b"): Event.REJECTED}


def test_a_goal_that_two_servers_accept_is_executed_twice() -> None:
    entries = [
        entry(1, "a", Event.ACCEPTED, pid=7),
        entry(1, "a", Event.ACCEPTED, pid=8),
        entry(2, "b", Event.ACCEPTED, pid=8),
    ]
    assert journal.executions(entries) == {(S, "a"): 2, (S, "b"): 1}
    assert journal.max_live(entries) == 3


@example([("a", Event.ACCEPTED), ("b", Event.ACCEPTED), ("a", Event.ABORTED)])
@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from(Event))))
def test_the_judge_agrees_with_counting(lines: list[tuple[str, Event]]) -> None:
    entries = [entry(n // 4, goal, event) for n, (goal, event) in enumerate(lines)]
    live: set[str] = set()
    most = 0
    for each in entries:
        if each.event is Event.ACCEPTED:
            live.add(each.goal)
        elif each.event in journal.ENDS:
            live.discard(each.goal)
        most = max(most, len(live))
    assert journal.max_live(entries) == most
