"""`make` sets up on any machine, or says in one clear sentence what that machine lacks.

The commands that may be missing or broken are played by small shell scripts.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAKEFILE = (ROOT / "Makefile").read_text()

pytestmark = pytest.mark.skipif(not shutil.which("make"), reason="needs GNU make")

Fake = Callable[[str, str], Path]


@pytest.fixture
def fake(tmp_path: Path) -> Fake:
    """Makes a command of the given name out of a few lines of shell."""
    folder = tmp_path / "commands"
    folder.mkdir()

    def make(name: str, script: str) -> Path:
        command = folder / name
        command.write_text(f"#!/bin/sh\n{script}\n")
        command.chmod(0o755)
        return command

    return make


def run(script: str, *arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ROOT / "scripts" / script, *map(str, arguments)],
        cwd=ROOT,
        env={"PATH": "/usr/bin:/bin"} | environment,
        capture_output=True,
        text=True,
    )


def sentence(done: subprocess.CompletedProcess[str]) -> str:
    """The one line that a failure says."""
    assert done.returncode != 0
    (line,) = done.stderr.splitlines()
    assert line.startswith("bt_actions: ")
    return line


PYTHON = """
case $1 in
-) exit {incomplete} ;;             # asks for the venv module and the C headers
-c) echo {version} ;;
-m) mkdir -p "$3/bin"; echo made "$3" ;;
esac
"""


class TestPython:
    def test_one_that_is_asked_for_and_too_old_is_refused(self, fake: Fake, tmp_path: Path) -> None:
        old = fake("python3.10", PYTHON.format(version="3.10", incomplete=0))
        assert sentence(run("venv.sh", tmp_path / "venv", old)) == (
            f"bt_actions: Python 3.11 or 3.12 is needed, and PYTHON={old} is Python 3.10."
        )

    def test_one_that_is_asked_for_and_does_not_run_is_refused(self, tmp_path: Path) -> None:
        said = sentence(run("venv.sh", tmp_path / "venv", "no-such-python"))
        assert said.endswith("and PYTHON=no-such-python does not run.")

    def test_one_without_headers_is_refused_with_the_packages_to_install(
        self, fake: Fake, tmp_path: Path
    ) -> None:
        python = fake("python3", PYTHON.format(version="3.12", incomplete=1))
        said = sentence(run("venv.sh", tmp_path / "venv", python))
        assert "python3.12-venv python3.12-dev" in said

    def test_a_machine_without_any_is_told_so(self, fake: Fake, tmp_path: Path) -> None:
        for name in ("python3.12", "python3.11", "python3"):
            command = fake(name, "exit 127")  # as a version manager's empty stand-in does
        said = sentence(run("venv.sh", tmp_path / "venv", PATH=f"{command.parent}:/usr/bin:/bin"))
        assert "none was found" in said

    def test_the_first_that_will_do_is_taken(self, fake: Fake, tmp_path: Path) -> None:
        fake("python3.12", "exit 127")
        fake("python3.11", PYTHON.format(version="3.11", incomplete=1))
        command = fake("python3", PYTHON.format(version="3.12", incomplete=0))
        done = run("venv.sh", tmp_path / "venv", PATH=f"{command.parent}:/usr/bin:/bin")
        assert (done.returncode, done.stderr) == (0, "")
        assert "with python3\n" in done.stdout

    def test_an_environment_of_another_version_is_not_reused(
        self, fake: Fake, tmp_path: Path
    ) -> None:
        environment = tmp_path / "venv"
        (environment / "bin").mkdir(parents=True)
        fake("python", PYTHON.format(version="3.11", incomplete=0)).rename(
            environment / "bin" / "python"
        )
        asked = fake("python3.12", PYTHON.format(version="3.12", incomplete=0))
        assert run("venv.sh", environment).returncode == 0
        assert "was made with Python 3.11" in sentence(run("venv.sh", environment, asked))

    def test_a_broken_environment_is_named(self, tmp_path: Path) -> None:
        (tmp_path / "venv").mkdir()
        assert "does not run any more" in sentence(run("venv.sh", tmp_path / "venv"))


class TestCompiler:
    @pytest.mark.parametrize(("variable", "language"), [("CC", "C"), ("CXX", "C++")])
    def test_a_missing_one_is_named(self, variable: str, language: str, fake: Fake) -> None:
        works = str(fake("works", "exit 0"))
        compilers = {"CC": works, "CXX": works} | {variable: "no-such-compiler"}
        said = sentence(run("compiler.sh", **compilers))
        assert f"no working {language} compiler" in said

    def test_one_that_cannot_compile_is_as_good_as_none(self, fake: Fake) -> None:
        broken = str(fake("broken", "exit 1"))
        assert "no working C compiler" in sentence(run("compiler.sh", CC=broken))

    def test_nothing_is_said_when_both_work(self, fake: Fake) -> None:
        works = str(fake("works", "exit 0"))
        done = run("compiler.sh", CC=works, CXX=works)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


class TestDownload:
    def pip(
        self, fake: Fake, tmp_path: Path, script: str, **variables: str
    ) -> subprocess.CompletedProcess[str]:
        (tmp_path / "venv" / "bin").mkdir(parents=True)
        fake("python", script).rename(tmp_path / "venv" / "bin" / "python")
        return run("pip.sh", tmp_path / "venv", "Installing", "install", "x", **variables)

    @pytest.mark.parametrize(
        "message",
        [
            "ERROR: No matching distribution found for rich==15.0.0",
            "ERROR: ResolutionImpossible: for help visit",
            "pip._vendor.urllib3.exceptions.ReadTimeoutError: HTTPSConnectionPool: timed out.",
            "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES",
        ],
    )
    def test_a_failed_one_is_told_in_one_sentence(
        self, message: str, fake: Fake, tmp_path: Path
    ) -> None:
        done = self.pip(fake, tmp_path, f"echo '{message}'; exit 1")
        assert "a download failed: check the network" in sentence(done)
        assert message in (tmp_path / "venv" / "pip.log").read_text()

    def test_one_on_a_machine_without_wheels_is_told_as_that(
        self, fake: Fake, tmp_path: Path
    ) -> None:
        path = f"{fake('uname', 'echo Linux aarch64').parent}:{os.environ['PATH']}"
        message = "ERROR: No matching distribution found for ros-rcl==9.2.8"
        said = sentence(self.pip(fake, tmp_path, f"echo '{message}'; exit 1", PATH=path))
        assert "Linux on x86_64 only, and this is Linux aarch64" in said
        assert "ROS 2 workspace" in said

    def test_pip_is_held_to_the_pinned_versions(self, fake: Fake, tmp_path: Path) -> None:
        done = self.pip(fake, tmp_path, "echo $PIP_CONSTRAINT $PIP_BUILD_CONSTRAINT")
        assert (done.returncode, done.stdout) == (0, "Installing\n")
        assert (tmp_path / "venv" / "pip.log").read_text() == "constraints.txt constraints.txt\n"


class TestMake:
    def test_help_tells_every_target(self) -> None:
        done = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True)
        told = re.findall(r"^make (\S+) +\S", done.stdout, re.MULTILINE)
        (phony,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)
        assert set(told) == set(phony.split()) - {"python", "colcon-python"}

    def test_a_sourced_ros_does_not_leak_into_the_environment(self) -> None:
        foreign = {
            "AMENT_PREFIX_PATH": "/opt/ros/jazzy",
            "CMAKE_PREFIX_PATH": "/opt/ros/jazzy",
            "LD_LIBRARY_PATH": "/opt/ros/jazzy/lib",
            "PYTHONPATH": "/opt/ros/jazzy/lib/python3.12/site-packages",
            "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp",
            "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        }
        done = subprocess.run(
            ["make", "--eval", "probe: ; @env", "probe"],
            cwd=ROOT,
            env=os.environ | foreign,
            capture_output=True,
            text=True,
            check=True,
        )
        seen = {line.partition("=")[0] for line in done.stdout.splitlines()}
        assert "PATH" in seen
        assert not seen & foreign.keys()
