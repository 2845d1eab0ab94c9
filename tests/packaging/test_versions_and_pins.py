"""One version everywhere, and no ROS package that could slip into a newer distribution."""

import configparser
import re
import sysconfig
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from bt_actions.packages.environment import pins

ROOT = Path(__file__).resolve().parents[2]
INTERFACES = sorted(path.parent for path in ROOT.glob("interfaces/*/package.xml"))


def setup_cfg() -> configparser.ConfigParser:
    parser = configparser.ConfigParser(interpolation=None)
    parser.read(ROOT / "setup.cfg")
    return parser


def requirements(text: str) -> list[Requirement]:
    return [Requirement(line) for line in text.split("\n") if line and not line.startswith("#")]


def runtime() -> list[Requirement]:
    return requirements(setup_cfg()["options"]["install_requires"])


def development() -> list[Requirement]:
    return requirements(setup_cfg()["options.extras_require"]["dev"])


def site() -> list[Requirement]:
    return requirements(setup_cfg()["options.extras_require"]["docs"])


def build_environment() -> list[Requirement]:
    return [Requirement(line) for line in pins()]


def constraints() -> dict[str, str]:
    pinned = requirements((ROOT / "constraints.txt").read_text())
    return {canonicalize_name(pin.name): exact_version(pin) for pin in pinned}


def exact_version(requirement: Requirement) -> str:
    found = re.fullmatch(r"==([^*]+)", str(requirement.specifier))
    assert found, f"{requirement} is not pinned exactly"
    return found[1]


def package_xml(folder: Path) -> tuple[str, str]:
    root = ET.parse(folder / "package.xml").getroot()
    return root.findtext("name", ""), root.findtext("version", "")


def installed_by_pip() -> dict[str, str]:
    """Without the second, bare name (rclpy beside ros-rclpy) that each ROS wheel carries.

    And without what setuptools brings along and puts on sys.path when it is imported.
    """
    return {
        canonicalize_name(found.name): found.version
        for found in distributions(path=[sysconfig.get_path("purelib")])
        if (found.read_text("INSTALLER") or "").strip() == "pip"
    }


needs_wheels = pytest.mark.skipif(
    "ros-jazzy-rclpy" not in installed_by_pip(), reason="ROS does not come from wheels here"
)


def test_name_and_version_are_the_same_for_pip_and_for_ros() -> None:
    metadata = setup_cfg()["metadata"]
    assert package_xml(ROOT) == (metadata["name"], metadata["version"])


def test_the_interfaces_of_this_very_version_are_required() -> None:
    required = {requirement.name: requirement for requirement in runtime()}
    for folder in INTERFACES:
        name, version = package_xml(folder)
        assert name == folder.name
        assert exact_version(required[name]) == version


def test_our_interfaces_are_built_by_the_one_build() -> None:
    assert len(INTERFACES) == 2
    backend = (ROOT / "interfaces" / "backend.py").resolve()
    for folder in INTERFACES:
        build = tomllib.loads((folder / "pyproject.toml").read_text())["build-system"]
        assert build == {"requires": [], "build-backend": "backend", "backend-path": ["."]}
        assert (folder / "backend.py").resolve() == backend


@pytest.mark.parametrize(
    "source", [runtime, development, build_environment], ids=lambda f: f.__name__
)
def test_every_ros_package_is_pinned_to_the_version_in_the_constraints(
    source: Callable[[], list[Requirement]],
) -> None:
    ros = [requirement for requirement in source() if requirement.name.startswith("ros-")]
    assert ros
    for requirement in ros:
        assert exact_version(requirement) == constraints()[requirement.name]


def test_the_constraints_fit_what_is_required() -> None:
    pinned = constraints()
    for requirement in runtime() + development() + site() + build_environment():
        if requirement.name not in {folder.name for folder in INTERFACES}:
            assert pinned[canonicalize_name(requirement.name)] in requirement.specifier


@needs_wheels
def test_no_ros_package_is_installed_that_the_metadata_does_not_name() -> None:
    named = {requirement.name for requirement in runtime() + development()}
    installed = {name for name in installed_by_pip() if name.startswith("ros-")}
    assert installed <= named


@needs_wheels
def test_what_is_installed_is_what_the_constraints_name() -> None:
    pinned = constraints()
    differing = {
        name: version
        for name, version in installed_by_pip().items()
        if name in pinned and version != pinned[name]
    }
    assert not differing
