"""Builds an ament_cmake package of this folder and hands its files to the package's wheel.

It runs CMake on the package's CMakeLists.txt, as colcon does, against the ROS 2 wheels of the build
environment. Headers and CMake exports stay out of the wheel: it is for running, not for building
upon.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LEFT_OUT = {"cmake", "environment", "hook", "parent_prefix_path"}
LEFT_OUT_SUFFIXES = {".bash", ".dsv", ".ps1", ".sh", ".zsh"}


class AmentCMakeHook(BuildHookInterface):
    """The wheel holds the generated Python package, `lib/*.so` and `share/`."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            raise SystemExit(f"{self.metadata.name} is generated code: install it without -e.")
        self._work = tempfile.TemporaryDirectory(prefix=f"{self.metadata.name}-")
        prefix = self._build(Path(self._work.name))

        build_data["pure_python"] = False
        build_data["infer_tag"] = True
        for path in sorted((prefix / "python").rglob("*")):
            relative = path.relative_to(prefix / "python")
            if path.suffix in {".py", ".so"}:
                build_data["force_include"][str(path)] = str(relative)
        # One entry a file: hatchling drops a directory given here without a word.
        for folder in ("lib", "share"):
            for path in sorted((prefix / folder).rglob("*")):
                relative = path.relative_to(prefix)
                if path.is_file() and _is_needed_to_run(relative):
                    build_data["shared_data"][str(path)] = str(relative)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        self._work.cleanup()

    def _build(self, work: Path) -> Path:
        """Configure, build and install into a temporary prefix, which is returned."""
        source = Path(self.root)
        ros = _ros_prefix()
        environment = os.environ | {
            "AMENT_PREFIX_PATH": str(ros),
            "CMAKE_PREFIX_PATH": str(ros),
            "LD_LIBRARY_PATH": str(ros / "lib"),
            # The ROS wheels restart Python to set LD_LIBRARY_PATH, unless told that it is set.
            "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        }
        build, prefix = work / "build", work / "prefix"
        configure = [
            "cmake", "-S", source, "-B", build, "-G", "Ninja",
            f"-DCMAKE_PROJECT_INCLUDE={Path(__file__).with_name('ros_wheels.cmake')}",
            f"-DCMAKE_INSTALL_PREFIX={prefix}",
            f"-DPython3_EXECUTABLE={sys.executable}",
            "-DPYTHON_INSTALL_DIR=python",
            "-DCMAKE_BUILD_TYPE=Release",
            "-DCMAKE_SKIP_INSTALL_RPATH=ON",
            "-DBUILD_TESTING=OFF",
        ]  # fmt: skip
        for command in (
            configure,
            ["cmake", "--build", build],
            ["cmake", "--install", build, "--strip"],
        ):
            subprocess.run(command, env=environment, check=True)
        return prefix


def _ros_prefix() -> Path:
    """Where the ROS wheels lie. Not sys.prefix: pip's build isolation leaves the caller's there."""
    for file in distribution("ros-ament-cmake-core").files or ():
        if str(file).endswith("share/ament_cmake_core/package.xml"):
            return Path(file.locate()).resolve().parents[2]
    raise SystemExit("ros-ament-cmake-core is installed without its package.xml: reinstall it.")


def _is_needed_to_run(path: Path) -> bool:
    return not LEFT_OUT.intersection(path.parts) and path.suffix not in LEFT_OUT_SUFFIXES
