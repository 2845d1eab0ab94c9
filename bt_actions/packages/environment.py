"""The build environment: CMake, Ninja and the generators of ROS, made once from pinned wheels.

Its folder lies in the user's cache, for all environments of the same Python. The folder's name says
what it is made of, so that another list of pins makes another one; deleting it costs a download.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

from bt_actions.packages import PackageError

PINS = Path(__file__).with_name("build_environment.txt")
_NO_PIP = (
    "neither pip nor uv is in this environment: `python -m ensurepip` installs pip, and "
    "https://docs.astral.sh/uv tells of uv"
)


@dataclass(frozen=True, slots=True)
class Tools:
    """Where the generators are, and the Python that runs them."""

    python: Path
    prefix: Path
    site: tuple[str, ...] = ()
    """Its Python packages, where they are not this process's own."""


def pins() -> list[str]:
    """Return the requirements of the build environment, each pinned."""
    lines = PINS.read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def cache() -> Path:
    """Return the folder of the build environment and of the logs of builds."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "bt_actions"


def installer(python: Path | None = None) -> list[str]:
    """Return the command, pip's or uv's, that installs into `python`'s environment, or this one.

    Raises PackageError where there is neither.
    """
    uv = shutil.which("uv")
    if _has_pip():
        where = [] if python is None else ["--python", str(python)]
        command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *where, "install"]
        return [*command, "--no-input"]
    if uv is not None:
        return [uv, "pip", "install", "--python", str(python or sys.executable)]
    raise PackageError(_NO_PIP)


def _has_pip() -> bool:
    return find_spec("pip") is not None


def build_environment(say: Callable[[str], None], *, network: bool) -> Tools:
    """Return the build environment; make it first, with a download, where it is missing.

    Raises PackageError where it is missing and `network` is False, or cannot be made.
    """
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    base = f"{sys.base_prefix} {sys.version}"
    key = hashlib.sha256(f"{base}\n{PINS.read_text()}".encode()).hexdigest()[:12]
    folder = cache() / f"build-{python}-{key}"
    tools = Tools(
        python=folder / "bin" / "python",
        prefix=folder,
        site=(str(folder / "lib" / f"python{python}" / "site-packages"),),
    )
    ready = folder / "ready"
    if ready.exists():
        return tools
    if not network:
        raise PackageError(
            f"the build environment is missing: {folder} is to hold the {len(pins())} packages "
            f"that {PINS} lists.\nRun it once without --no-network, which downloads them."
        )
    with _alone(folder.parent / f"{folder.name}.lock", say):
        if not ready.exists():
            command = installer(tools.python)
            say(f"making the build environment once, of {len(pins())} packages: {folder}")
            shutil.rmtree(folder, ignore_errors=True)
            _run([sys.executable, "-m", "venv", "--without-pip", folder])
            _run([*command, "--quiet", "--requirement", PINS])
            ready.touch()
    return tools


@contextlib.contextmanager
def _alone(lock: Path, say: Callable[[str], None]) -> Iterator[None]:
    """Hold back other processes that would make the same environment."""
    lock.parent.mkdir(parents=True, exist_ok=True)
    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another process is making the build environment; waiting for it")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _run(command: list[str | Path]) -> None:
    done = subprocess.run(command, env=_clean(), capture_output=True, text=True)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        said = (lines or done.stderr.splitlines() or ["it said nothing"])[-1].strip()
        raise PackageError(
            f"the build environment could not be made: {said[:300]}\n"
            "Its wheels are for Linux on x86_64; check the network and pip's package index."
        )


def own_prefix() -> Path:
    """Return this environment's prefix, which has the headers and CMake exports of ROS's wheels.

    Raises PackageError where ROS does not come from wheels.
    """
    prefix = Path(sysconfig.get_path("data"))
    if not (prefix / "share" / "rosidl_runtime_c" / "cmake").is_dir():
        raise PackageError(
            f"ROS 2 is not installed from wheels in {prefix}: in a ROS workspace, `colcon build` "
            "builds interface packages, and nothing of this is needed (docs/workspace.md)"
        )
    return prefix


def own_tools() -> Tools:
    """Return the generators that are installed for this process, as in pip's build isolation.

    sys.prefix would not do: build isolation leaves the caller's there.
    """
    for file in distribution("ros-ament-cmake-core").files or ():
        if str(file).endswith("share/ament_cmake_core/package.xml"):
            return Tools(Path(sys.executable), Path(str(file.locate())).resolve().parents[2])
    raise PackageError("ros-ament-cmake-core is installed without its package.xml: reinstall it")


def variables(tools: Tools, prefixes: Sequence[Path] = ()) -> dict[str, str]:
    """Return the environment variables of a process that builds with `tools` upon `prefixes`."""
    looked_in = os.pathsep.join(map(str, (tools.prefix, *prefixes)))
    return {
        **(_clean() if tools.site else os.environ),
        "PATH": f"{tools.prefix / 'bin'}{os.pathsep}{os.environ.get('PATH', os.defpath)}",
        "AMENT_PREFIX_PATH": looked_in,
        "CMAKE_PREFIX_PATH": looked_in,
        "LD_LIBRARY_PATH": str(tools.prefix / "lib"),
        # The ROS wheels restart Python to set LD_LIBRARY_PATH, unless told that it is set.
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
    }


def _clean() -> dict[str, str]:
    """Return this process's variables without those that lead another Python to our packages."""
    mine = {"PYTHONPATH", "PYTHONHOME", "LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    return {name: value for name, value in os.environ.items() if name not in mine}


def check_compilers() -> None:
    """Raise PackageError where C, C++ or Python's C headers are missing."""
    for language, kind, names in (
        ("C", "c", os.environ.get("CC") or "cc gcc clang"),
        ("C++", "c++", os.environ.get("CXX") or "c++ g++ clang++"),
    ):
        if not any(_compiles(name, kind) for name in names.split()):
            raise PackageError(
                f"no working {language} compiler was found (tried {names}): install one (Debian: "
                "build-essential)"
            )
    if not (Path(sysconfig.get_path("include")) / "Python.h").exists():
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise PackageError(
            f"Python's C headers are missing: install them (Debian: python{version}-dev)"
        )


def _compiles(compiler: str, kind: str) -> bool:
    command = [compiler, "-x", kind, "-fsyntax-only", "-"]
    try:
        text = "#include <stdlib.h>\n"
        return subprocess.run(command, input=text, text=True, capture_output=True).returncode == 0
    except OSError:
        return False
