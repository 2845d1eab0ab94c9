"""A filled prefix becomes a wheel: what running needs, and what building upon it needs.

The pypa's `wheel`, in the build environment, records and packs it.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from importlib.metadata import distributions
from pathlib import Path

from bt_actions.packages import PackageError
from bt_actions.packages.environment import Tools, variables
from bt_actions.packages.order import needs
from bt_actions.packages.sources import Package

GENERATOR = "bt-actions interfaces"
"""The name of the maker in our wheels; wheels of others are never overwritten."""
_RUNTIME = ("ros-rosidl-default-runtime", "ros-rosidl-generator-py", "ros-action-msgs")
_SHELL = {"environment", "hook", "parent_prefix_path"}
_SHELL_SUFFIXES = {".bash", ".dsv", ".ps1", ".sh", ".zsh"}
"""Of scripts that make a shell's environment; the wheels of ROS do so in Python."""


def pack(
    source: Package, prefix: Path, tools: Tools, built: Iterable[Package], work: Path, out: Path
) -> Path:
    """Write the wheel of `source`, which lies in `prefix`, into `out`; return its path."""
    root = work / "wheel"
    for path in sorted(prefix.rglob("*")):
        relative = path.relative_to(prefix)
        if path.is_dir() or not _is_wanted(relative):
            continue
        if relative.parts[0] == "python":
            target = root / relative.relative_to("python")
        else:
            target = root / f"{source.name}-{source.version}.data" / "data" / relative
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    described = root / f"{source.name}-{source.version}.dist-info"
    described.mkdir(parents=True)
    (described / "METADATA").write_text(_metadata(source, tools, built), encoding="utf-8")
    (described / "WHEEL").write_text(
        f"Wheel-Version: 1.0\nGenerator: {GENERATOR}\nRoot-Is-Purelib: false\nTag: {_tag()}\n"
    )
    out.mkdir(parents=True, exist_ok=True)
    command = [str(tools.python), "-m", "wheel", "pack", str(root), "--dest-dir", str(out)]
    done = subprocess.run(command, env=variables(tools), capture_output=True, text=True)
    if done.returncode != 0:
        raise PackageError(f"{source.name} could not be packed: {done.stderr.strip()[-300:]}")
    return out / f"{source.name}-{source.version}-{_tag()}.whl"


def _is_wanted(path: Path) -> bool:
    if path.parts[0] == "python":
        return path.suffix in {".py", ".so"} and not path.parts[1].endswith(".egg-info")
    return not _SHELL.intersection(path.parts) and path.suffix not in _SHELL_SUFFIXES


def _tag() -> str:
    """Return the Python that a wheel is for: its extension files carry no ABI in their names."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"


def _metadata(source: Package, tools: Tools, built: Iterable[Package]) -> str:
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    lines = [
        "Metadata-Version: 2.1",
        f"Name: {source.name}",
        f"Version: {source.version}",
        f"Summary: {source.description}",
        f"License: {' '.join(source.license.split())}",
        f"Requires-Python: =={python}.*",
        "Requires-Dist: numpy",
        *(f"Requires-Dist: {each}" for each in _requirements(source, tools, built)),
    ]
    return "\n".join(lines) + "\n"


def _requirements(source: Package, tools: Tools, built: Iterable[Package]) -> Sequence[str]:
    """Return what the wheel needs, in exact versions: the layout of messages is compiled in."""
    found = {each.name: each.version for each in built}
    for each in distributions(path=[*tools.site, *sys.path]):
        found.setdefault(each.name, each.version)
    wanted = list(_RUNTIME)
    for package in needs(source):
        from_ros = f"ros-{package.replace('_', '-')}"
        wanted.append(from_ros if from_ros in found else package)
    return sorted({f"{name}=={found[name]}" if name in found else name for name in wanted})
