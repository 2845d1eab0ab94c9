"""A reader that pauses: --timeout and signals take effect all the same, and it gets everything.

Real processes, whose standard output or error is a pipe that was full before they began. The
server's journal is the judge of what happened to a goal.
"""

from __future__ import annotations

import contextlib
import errno
import os
import pty
import signal
import subprocess
import sys
import termios
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bt_actions.cli.driving.signals import SAME_WISH
from bt_actions.cli.streams import patient_file
from bt_actions.cli.streams.patient_file import PatientFile, gap_text
from bt_actions.cli.streams.patient_output import PatientOutput
from tests.support.processes import PATIENCE, ROOT, Journal
from tests.support.waiting import holds_for, until

Robot = Callable[..., Journal]
Tree = Callable[..., Path]
FILL = b"x"


class FullPipe:
    """A pipe into which nothing goes any more, until it is read."""

    def __init__(self) -> None:
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.writer, False)
        for size in (4096, 1):
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(self.writer, FILL * size)
        os.set_blocking(self.writer, True)

    def read(self) -> list[str]:
        """Read to the end, as one does who has woken up; return the lines."""
        os.close(self.writer)
        return self.lines()

    def lines(self) -> list[str]:
        """Read until nobody can write to it any more."""
        with open(self.reader, "rb", closefd=False) as reader:
            return reader.read().lstrip(FILL).decode().splitlines()


@pytest.fixture
def pipe() -> FullPipe:
    return FullPipe()


Begin = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def begin(no_leaks: None) -> Iterator[Begin]:
    """Start `bt-actions` with descriptors of the test's."""
    begun: list[subprocess.Popen[bytes]] = []

    def begin(*arguments: str, stdout: int, stderr: int, path: str = "") -> subprocess.Popen[bytes]:
        begun.append(
            subprocess.Popen(
                [sys.executable, "-m", "bt_actions.cli", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=stdout,
                stderr=stderr,
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": f"{ROOT}:{path}"},
            )
        )
        return begun[-1]

    yield begin
    for process in begun:
        if process.poll() is None:
            process.kill()
        process.communicate()


def in_order(lines: list[str], *wanted: str) -> bool:
    left = iter(lines)
    return all(any(word in line for line in left) for word in wanted)


@pytest.mark.parametrize(("how", "code"), [("--timeout", 124), ("--json", 130)])
def test_what_ends_a_run_cancels_its_goal_though_nobody_reads(
    how: str, code: int, begin: Begin, pipe: FullPipe, robot: Robot, namespace: str, tree: Tree
) -> None:
    journal = robot("1:slow=200", speed=1.0)
    more = {"--timeout": ["--timeout", "4"], "--json": ["--json"]}.get(how, [])
    run = begin(
        *("run", str(tree()), "--namespace", namespace, *more),
        stdout=pipe.writer,
        stderr=subprocess.DEVNULL,
    )
    journal.wait_for("accepted", within=PATIENCE)
    if how != "--timeout":
        run.send_signal(signal.SIGINT)
    journal.wait_for("canceled", within=10.0)
    assert holds_for(lambda: run.poll() is None, 2 * SAME_WISH), "its report waits to be read"
    lines = pipe.read()
    assert run.wait(PATIENCE) == code
    cause = "--timeout 4 s expired" if how == "--timeout" else "interrupted by"
    if how == "--json":
        assert in_order(lines, '"started"', '"SENDING"', cause, '"CANCELED"', '"finished"')
    else:
        assert in_order(lines, "RUNNING  Work", f"{cause}", "CANCELED", "STOPPED after")
    last = [line for line in lines if "finished" in line or "STOPPED after" in line]
    assert last
    assert "executing" not in "".join(lines[lines.index(last[-1]) :]), "the report comes last"


def test_a_signal_ends_the_wait_for_a_reader(
    begin: Begin, pipe: FullPipe, robot: Robot, namespace: str, tree: Tree
) -> None:
    journal = robot()
    run = begin(
        *("run", str(tree()), "--namespace", namespace), stdout=pipe.writer, stderr=pipe.writer
    )
    journal.wait_for("succeeded", within=PATIENCE)
    assert holds_for(lambda: run.poll() is None, 1.0), "it waits for its reader"
    run.send_signal(signal.SIGTERM)
    assert run.wait(3.0) == 0, "the run was over: its code stands"


def test_so_does_the_timeout_that_expires_meanwhile(
    begin: Begin, pipe: FullPipe, robot: Robot, namespace: str, tree: Tree
) -> None:
    journal = robot()
    run = begin(
        *("run", str(tree()), "--namespace", namespace, "--timeout", "5"),
        stdout=pipe.writer,
        stderr=subprocess.DEVNULL,
    )
    journal.wait_for("succeeded", within=PATIENCE)
    assert run.wait(PATIENCE) == 0


def test_a_second_signal_leaves_though_nobody_reads(
    begin: Begin, pipe: FullPipe, robot: Robot, namespace: str, tree: Tree
) -> None:
    journal = robot("1:drop_cancel", speed=0.1)
    path = tree(timeout="{result: 60 s, feedback: 60 s, cancel: 60 s}")
    run = begin(
        *("run", str(path), "--namespace", namespace), stdout=pipe.writer, stderr=pipe.writer
    )
    journal.wait_for("accepted", within=PATIENCE)
    run.send_signal(signal.SIGINT)
    assert holds_for(lambda: run.poll() is None, 2 * SAME_WISH)
    run.send_signal(signal.SIGINT)
    assert run.wait(5.0) == 3


CHATTER = """\
import sys
import rclpy.logging
from py_trees.behaviour import Behaviour
from py_trees.common import Status

class Chatter(Behaviour):
    def update(self):
        print("printed", file=sys.stderr, flush=True)
        for _ in range(TIMES):
            rclpy.logging.get_logger("chatter").warning("logged with the GIL held" * WORDS)
        return Status.RUNNING
"""


def chatty(tree: Tree, directory: Path, *, times: int = 1, words: int = 1) -> Path:
    """Write a tree that moves and logs at once."""
    code = CHATTER.replace("TIMES", str(times)).replace("WORDS", str(words))
    (directory / "chatter.py").write_text(code)
    text = tree().read_text().replace("sequence: Work", "parallel: Work")
    path = directory / "chatty.yaml"
    path.write_text(text.replace("one_move", "chatty") + "    - python: chatter.Chatter\n")
    return path


def test_a_full_standard_error_stops_nothing_either(
    begin: Begin, pipe: FullPipe, robot: Robot, namespace: str, tree: Tree, tmp_path: Path
) -> None:
    journal = robot("1:slow=200", speed=1.0)
    run = begin(
        *("run", str(chatty(tree, tmp_path)), "--namespace", namespace),
        stdout=subprocess.PIPE,
        stderr=pipe.writer,
        path=str(tmp_path),
    )
    journal.wait_for("accepted", within=PATIENCE)
    run.send_signal(signal.SIGINT)
    journal.wait_for("canceled", within=10.0)
    lines = pipe.read()
    assert run.wait(PATIENCE) == 130
    assert in_order(lines, "printed", "logged with the GIL held", "printed")
    assert run.stdout is not None
    assert b"STOPPED after" in run.stdout.read()


def test_a_terminal_that_was_stopped_with_ctrl_s_stops_nothing(
    begin: Begin, robot: Robot, namespace: str, tree: Tree
) -> None:
    journal = robot("1:slow=200", speed=1.0)
    master, terminal = pty.openpty()
    termios.tcflow(terminal, termios.TCOOFF)
    run = begin(
        *("run", str(tree()), "--namespace", namespace, "--timeout", "4"),
        stdout=terminal,
        stderr=terminal,
    )
    journal.wait_for("canceled", within=PATIENCE)
    assert holds_for(lambda: run.poll() is None, 2 * SAME_WISH), "its report waits to be read"
    termios.tcflow(terminal, termios.TCOON)
    os.close(terminal)
    text = read_terminal(master)
    assert run.wait(PATIENCE) == 124
    assert b"STOPPED after" in text
    assert b"\x1b[?25h" in text[text.rindex(b"\x1b[?25l") :], "the cursor is back"


def test_a_burst_of_the_log_does_not_stop_a_run_that_is_drawn(
    begin: Begin, robot: Robot, namespace: str, tree: Tree, tmp_path: Path
) -> None:
    journal = robot("1:slow=200", speed=1.0)
    path = chatty(tree, tmp_path, times=20, words=400)
    master, terminal = pty.openpty()
    run = begin(
        *("run", str(path), "--namespace", namespace, "--timeout", "4"),
        stdout=terminal,
        stderr=terminal,
        path=str(tmp_path),
    )
    os.close(terminal)
    reader = threading.Thread(target=read_terminal, args=(master,))
    reader.start()
    journal.wait_for("canceled", within=PATIENCE)
    assert run.wait(PATIENCE) == 124
    reader.join()


def read_terminal(master: int) -> bytes:
    """Read until all have left it."""
    text = b""
    with contextlib.suppress(OSError):
        while block := os.read(master, 65536):
            text += block
    return text


# The file by itself


@pytest.fixture
def file(pipe: FullPipe) -> Iterator[PatientFile]:
    file = PatientFile(pipe.writer, "test")
    yield file
    with contextlib.suppress(OSError):
        os.close(pipe.reader)
    file.end()


def read_late(file: PatientFile, pipe: FullPipe) -> list[str]:
    """Read what waits; return the lines."""
    assert not file.written(0.0)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.extend(pipe.lines()))
    reader.start()
    assert file.written(PATIENCE)
    os.close(pipe.writer)
    reader.join()
    return got


def test_what_waits_is_bounded_and_a_line_says_what_is_missing(
    file: PatientFile, pipe: FullPipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(patient_file, "MOST", 10_000)
    for number in range(1000):
        file.write(f"line {number}\n".encode())
    got = read_late(file, pipe)
    told = [line for line in got if "missing" in line]
    kept = [line for line in got if "missing" not in line]
    missing = [int(line.split()[1]) for line in told]
    assert told == [gap_text(count).strip() for count in missing]
    assert len(kept) + sum(missing) == 1000
    assert kept[-50:] == [f"line {number}" for number in range(950, 1000)]
    assert len(kept) < 500


def test_a_line_above_the_bound_drops_nothing_and_is_not_dropped(
    file: PatientFile, pipe: FullPipe
) -> None:
    lines = ["before", "*" * 2 * patient_file.MOST, "after", "and last"]
    for line in lines:
        file.write(f"{line}\n".encode())
    got = read_late(file, pipe)
    assert got == lines


def test_a_file_on_a_disk_gets_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patient_file, "MOST", 1000)
    with (tmp_path / "out").open("wb") as out:
        file = PatientFile(out.fileno(), "test")
        with file._changed:  # so the thread that writes is behind
            for number in range(1000):
                file.write(f"line {number}\n".encode())
        assert file.written(PATIENCE)
        file.end()
    assert (tmp_path / "out").read_text().split("\n")[:-1] == [f"line {n}" for n in range(1000)]


def test_an_error_is_raised_once_by_the_main_thread_and_by_no_other(
    file: PatientFile, pipe: FullPipe
) -> None:
    file.write(b"nobody will read this\n")
    os.close(pipe.reader)
    until(lambda: file._error is not None)
    leaf = threading.Thread(target=lambda: file.write(b"printed by a leaf\n"))
    leaf.start()
    leaf.join()
    with pytest.raises(BrokenPipeError):
        file.written(PATIENCE)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, pipe.writer)
    os.close(nowhere)
    with contextlib.suppress(BrokenPipeError):  # the leaf's
        file.flush()
    file.write(b"into nowhere\n")
    assert file.written(PATIENCE)


def test_a_full_disk_reaches_the_main_thread() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    full = os.open("/dev/full", os.O_WRONLY)
    file = PatientFile(full, "test")
    file.write(b"x\n")
    with pytest.raises(OSError, match="No space left") as caught:
        file.written(PATIENCE)
    assert caught.value.errno == errno.ENOSPC
    file.end()
    os.close(full)


def test_it_looks_as_the_real_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    master, terminal = pty.openpty()
    real = open(terminal, "w", encoding="latin-1", errors="backslashreplace")  # noqa: PTH123, SIM115
    monkeypatch.setattr(sys, "stdout", real)
    with PatientOutput() as output:
        assert sys.stdout is not real
        assert (sys.stdout.isatty(), sys.stdout.fileno()) == (True, terminal)
        assert (sys.stdout.encoding, sys.stdout.errors) == ("latin-1", "backslashreplace")
        print("ä✓", flush=True)
        assert output.written(PATIENCE)
    assert sys.stdout is real
    shown = os.read(master, 100)
    while not shown.endswith(b"\n"):  # a terminal hands on what it has by now
        shown += os.read(master, 100)
    assert shown == "ä".encode("latin-1") + b"\\u2713\r\n"
    real.close()
    os.close(master)


def test_a_pipe_that_somebody_has_made_non_blocking_is_waited_for(
    file: PatientFile, pipe: FullPipe
) -> None:
    os.set_blocking(pipe.writer, False)
    file.write(b"all the same\n")
    assert not file.written(0.2)
    assert os.read(pipe.reader, 1 << 20)
    assert file.written(PATIENCE)
    assert os.read(pipe.reader, 1 << 20).lstrip(FILL) == b"all the same\n"
