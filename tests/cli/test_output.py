"""Standard output that cannot be written, or is not there: one line on stderr, the right code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FULL = Path("/dev/full")
DEMO = ("run", "pick_and_place", "--sim", "--speed", "30")


def call(redirection: str, *arguments: str, path: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Call `bt-actions` from a shell, its standard output redirected; `path` has more modules."""
    command = f'exec "$0" -m bt_actions.cli "$@" {redirection}'
    return subprocess.run(
        ["sh", "-c", command, sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT}:{path}"},
        check=False,
    )


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["schema"],
        ["check", "no_such_tree"],
    ],
    ids=" ".join,
)
def test_output_that_is_lost_is_one_line_and_exit_code_2(arguments: list[str]) -> None:
    done = call(f">{FULL}", *arguments)
    assert done.returncode == 2
    assert done.stderr == (
        "bt-actions: standard output cannot be written: No space left on device\n"
    )


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
def test_a_run_whose_result_is_lost_is_no_success(domain: int) -> None:
    done = call(f">{FULL}", *DEMO, "--json")
    assert done.returncode == 1
    lost, ended = done.stderr.splitlines()
    assert lost.startswith("bt-actions: the output cannot be written, and the run goes on: ")
    assert ended == "bt-actions: exit code 1: the tree has succeeded, but its output is lost"
    assert "Traceback" not in done.stderr


def test_a_standard_output_that_is_closed_is_one_that_goes_nowhere(domain: int) -> None:
    done = call(">&-", *DEMO)
    assert (done.returncode, done.stderr) == (0, "")


def test_help_without_a_standard_output_is_no_error() -> None:
    assert call(">&-", "--help").returncode == 0


def bare(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Call `bt-actions` with hardly a variable but `more`."""
    kept = ("PATH", "ROS_DOMAIN_ID", "XDG_STATE_HOME")
    environment = {name: os.environ[name] for name in kept if name in os.environ}
    return subprocess.run(
        [sys.executable, "-m", "bt_actions.cli", *arguments],
        capture_output=True,
        text=True,
        errors="surrogateescape",
        cwd=ROOT,
        env={**environment, "PYTHONPATH": str(ROOT), **more},
        check=False,
    )


@pytest.mark.parametrize(
    "variables",
    [{}, {"HOME": "/proc/1/nowhere"}, {"ROS_HOME": "/dev/null/x"}, {"PYTHONOPTIMIZE": "2"}],
    ids=["no home", "a home that is not there", "a home that is none", "no docstrings"],
)
def test_a_run_works_all_the_same(domain: int, variables: dict[str, str]) -> None:
    done = bare(*DEMO, **variables)
    assert (done.returncode, done.stderr) == (0, "")
    assert "SUCCESS after" in done.stdout.splitlines()[-1]


def test_a_recording_that_cannot_be_is_said_on_one_line_and_the_tree_goes_on(domain: int) -> None:
    done = bare(*DEMO, XDG_STATE_HOME="/proc/1/nowhere")
    assert done.returncode == 0
    assert done.stderr == (
        "bt-actions: this run is not recorded: /proc/1/nowhere: No such file or directory; "
        "set XDG_STATE_HOME to a folder that can be written, or say --no-record\n"
    )
    assert "SUCCESS after" in done.stdout.splitlines()[-1]


def test_a_folder_for_logs_that_cannot_be_is_named_with_the_remedy(domain: int) -> None:
    done = bare(*DEMO, ROS_LOG_DIR="/proc/1/nowhere")
    assert done.returncode == 2
    assert done.stderr == (
        "bt-actions: ROS 2 cannot start: the log cannot be written; "
        "set ROS_LOG_DIR to a folder that can be written\n"
    )


def test_a_name_of_a_file_that_is_no_utf_8_is_one_like_others(tmp_path: Path, domain: int) -> None:
    odd = os.fsdecode(bytes(tmp_path / "says") + b"\xff")
    Path(f"{odd}.yaml").write_text("tree: says\nroot: {log: hello}\n")
    done = bare("run", f"{odd}.yaml", "--sim", "--json", "--record", f"{odd}.mcap")
    assert (done.returncode, done.stderr.count("\n")) == (0, 1), done.stderr
    assert '"hello"' in bare("replay", f"{odd}.mcap", "--json").stdout
    assert json.loads(done.stdout.splitlines()[1])["place"] == f"{odd}.yaml:2:8"
    for form in ("svg", "html", "txt"):
        assert bare("render", f"{odd}.yaml", "-o", f"{odd}.{form}").returncode == 0
        assert Path(f"{odd}.{form}").stat().st_size


def test_a_folder_of_trees_whose_name_no_message_carries_is_refused_in_one_line(
    tmp_path: Path, domain: int
) -> None:
    odd = os.fsdecode(bytes(tmp_path / "trees") + b"\xff")
    Path(odd).mkdir()
    done = bare("serve", "--trees", odd)
    assert done.returncode == 2
    assert done.stderr == (
        f"bt-actions: --trees: {tmp_path}/trees\\udcff is no UTF-8, as ROS wants it\n"
    )


TALKER = """\
import atexit, ctypes, logging, os, subprocess, sys
from py_trees.behaviour import Behaviour
from py_trees.common import Status

def talk(when):
    print("print", when)
    print("*" * 3_000_000)
    sys.__stdout__.write(f"old stream {when}\\n")
    os.write(1, f"descriptor {when}\\n".encode())
    ctypes.CDLL(None).puts(f"C {when}".encode())
    subprocess.run(["echo", "child", when])
    logging.basicConfig(stream=sys.stdout, force=True)
    logging.warning("logger %s", when)

talk("imported")
atexit.register(talk, "at exit")

class Talker(Behaviour):
    def __init__(self, name):
        super().__init__(name)
        talk("made")
    def setup(self, **_):
        talk("set up")
        self.logger.info("py_trees set up")
    def update(self):
        talk("ticked")
        return Status.SUCCESS
    def terminate(self, _):
        talk("terminated")
    def shutdown(self):
        talk("shut down")
"""
RUN = ("imported", "made", "set up", "ticked", "terminated", "shut down", "at exit")


@pytest.mark.parametrize(
    ("command", "when"),
    [
        ("run --json", RUN),
        ("check --format json", ("imported", "at exit")),
        ("render", ("imported", "made", "at exit")),
    ],
    ids=["run", "check", "render"],
)
def test_standard_output_has_results_alone_and_all_else_goes_to_standard_error(
    command: str, when: tuple[str, ...], tmp_path: Path, domain: int
) -> None:
    (tmp_path / "talker.py").write_text(TALKER)
    tree = tmp_path / "t.yaml"
    tree.write_text("tree: t\nroot: {python: talker.Talker, name: It talks}\n")
    done = call("", *command.split(), str(tree), path=tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    if command == "render":
        assert done.stdout == "--> It talks  (Talker)\n"
    else:
        objects = [json.loads(text) for text in done.stdout.splitlines() if "run" in command]
        assert (
            objects[-1]["event"] == "finished" if objects else json.loads(done.stdout) is not None
        )
    said = done.stderr.splitlines()
    for each in when:
        for who in ("print", "old stream", "descriptor", "C", "child", "WARNING:root:logger"):
            assert said.count(f"{who} {each}") == 1, (who, each)
    assert said.count("*" * 3_000_000) == len(when), "a print of any length"


def test_who_calls_a_command_from_a_program_has_its_standard_output_again() -> None:
    code = (
        "from bt_actions.cli import main; import os\n"
        "for _ in range(2): main(['check', 'pick_and_place', '--format', 'json'])\n"
        "print('print', flush=True); os.write(1, b'descriptor')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout == "[]\n[]\nprint\ndescriptor"
