"""One package by rosidl and CMake, into a prefix of its own; its sources are left alone."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from bt_actions.packages import PackageError
from bt_actions.packages.environment import Tools, cache, variables
from bt_actions.packages.order import needs
from bt_actions.packages.sources import Package

_REPAIR = Path(__file__).with_name("ros_wheels.cmake")
_CMAKE_LISTS = """\
cmake_minimum_required(VERSION 3.22)
project({name} VERSION {version})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}}
  {files}
  DEPENDENCIES {needs}
  SKIP_GROUP_MEMBERSHIP_CHECK
)
ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""
Progress = Callable[[str, str], None]
"""Hears of each step that begins, and then how far it is, "12 of 340"."""
_COUNT = re.compile(r"\[(\d+)/(\d+)\]")


def generate(
    source: Package, prefixes: Sequence[Path], tools: Tools, work: Path, progress: Progress
) -> Path:
    """Generate, compile and install `source` into a prefix in `work`, which is returned.

    Raises PackageError, which names the log.
    """
    lists, build, prefix = work / "source", work / "build", work / "prefix"
    lists.mkdir(parents=True)
    shutil.copy(source.folder / "package.xml", lists)
    for file in source.files:
        (lists / file).parent.mkdir(exist_ok=True)
        shutil.copy(source.folder / file, lists / file)
    packages = needs(source)
    (lists / "CMakeLists.txt").write_text(
        _CMAKE_LISTS.format(
            name=source.name,
            version=source.version,
            finds="\n".join(f"find_package({each} REQUIRED)" for each in packages),
            files="\n  ".join(f'"{file}"' for file in source.files),
            needs=" ".join(packages),
        )
    )
    environment = {"CMAKE_BUILD_TYPE": "Release"} | variables(tools, prefixes)
    cmake = shutil.which("cmake", path=environment["PATH"])
    if cmake is None or shutil.which("ninja", path=environment["PATH"]) is None:
        raise PackageError(
            f"there is no CMake or no Ninja in {tools.prefix}: delete that folder, and try again"
        )
    configure: list[str | Path] = [
        cmake, "-S", lists, "-B", build, "-G", "Ninja",
        f"-DCMAKE_PROJECT_INCLUDE={_REPAIR}",
        f"-DCMAKE_INSTALL_PREFIX={prefix}",
        f"-DPython3_EXECUTABLE={tools.python}",
        "-DPYTHON_INSTALL_DIR=python",
        "-DCMAKE_SKIP_INSTALL_RPATH=ON",
        "-DBUILD_TESTING=OFF",
    ]  # fmt: skip
    log = work / "log"
    steps: list[tuple[str, list[str | Path]]] = [
        ("configuring", configure),
        ("compiling", [cmake, "--build", build]),
        ("collecting", [cmake, "--install", build, "--strip"]),
    ]
    for step, command in steps:
        progress(f"{source.name}: {step}", "")
        if not _run(command, environment, log, partial(progress, f"{source.name}: {step}")):
            kept = cache() / f"{source.name}.log"
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(log, kept)
            reason = _reason(log).replace(str(lists), str(source.folder))
            raise PackageError(
                f"{step} {source.name} failed: {reason}\nAll that CMake said is in {kept}"
            )
    return prefix


def _run(
    command: Sequence[str | Path],
    environment: dict[str, str],
    log: Path,
    done: Callable[[str], None],
) -> bool:
    """Run one step; tell how far it is. A Ctrl-C ends the step and all that it started."""
    with (
        log.open("a", encoding="utf-8") as file,
        subprocess.Popen(
            command, env=environment, text=True, errors="replace", start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ) as process,
    ):  # fmt: skip
        assert process.stdout is not None
        try:
            for line in process.stdout:
                file.write(line)
                if found := _COUNT.match(line):
                    done(f"{found[1]} of {found[2]}")
            return process.wait() == 0
        except BaseException:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)
            raise


def _reason(log: Path) -> str:
    """Return the reason that a log gives: Python's first exception, or a compiler's first error."""
    lines = [line for line in log.read_text(encoding="utf-8").splitlines() if line.strip()]
    for number, line in enumerate(lines):
        after = lines[number + 1 :]
        if line.startswith("Traceback"):
            after = after[next((n for n, each in enumerate(after) if each[0] != " "), 0) :]
            return " ".join(each for each in after[:2] if not each.startswith("CMake"))[:300]
        if line.startswith("CMake Error"):
            return " ".join(each.strip() for each in after[:2])[:300]
        if re.search(r": (fatal )?error: ", line):
            return line[:300]
    return (lines or ["nothing was said"])[-1][:300]
