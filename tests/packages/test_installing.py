"""A wheel never overwrites what somebody else has installed, nor what is newer."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.packages import PackageError
from bt_actions.packages.installing import check_names, left_behind
from bt_actions.packages.sources import Package, read_package
from bt_actions.packages.wheel import GENERATOR
from tests.packages.conftest import Write

pytest.importorskip("rosidl_adapter")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment's packages: two built by us, the second upon the first, and another's."""
    site = tmp_path / "site"
    for name, version, generator, requires in (
        ("built_msgs", "1.2.0", GENERATOR, "numpy"),
        ("upon_msgs", "1.0.0", GENERATOR, "built_msgs==1.2.0"),
        ("their_msgs", "1.0.0", "setuptools", "numpy"),
    ):
        described = site / f"{name}-{version}.dist-info"
        described.mkdir(parents=True)
        (described / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\nRequires-Dist: {requires}\n"
        )
        (described / "WHEEL").write_text(f"Wheel-Version: 1.0\nGenerator: {generator}\n")
    (site / "plain_msgs.py").touch()
    (site / "folder_msgs").mkdir()
    monkeypatch.syspath_prepend(site)
    return site


def source(write: Write, name: str, version: str = "1.0.0") -> Package:
    return read_package(write(name, {"msg/A.msg": "int32 a\n"}, version=version))


def refused(source: Package) -> str:
    with pytest.raises(PackageError) as raised:
        check_names([source])
    return str(raised.value).removeprefix(f"{source.folder}: ")


@pytest.mark.usefixtures("installed")
def test_a_name_that_another_s_package_has_is_refused(write: Write) -> None:
    assert refused(source(write, "their_msgs", "9.0.0")).startswith(
        "their_msgs 1.0.0 is installed already, and was not built by this command"
    )
    assert refused(source(write, "plain_msgs")).startswith("there is a Python module 'plain_msgs'")
    assert refused(source(write, "json")).startswith("there is a Python module 'json'")


@pytest.mark.usefixtures("installed")
def test_a_package_that_is_older_than_what_is_installed_is_refused(write: Write) -> None:
    assert refused(source(write, "built_msgs", "1.1.9")) == (
        "built_msgs is 1.1.9, and 1.2.0 is installed: raise its <version>, or "
        "`pip uninstall built_msgs` first"
    )
    for version in ("1.2.0", "1.10.0"):
        check_names([source(write, "built_msgs", version)])
    check_names([source(write, "folder_msgs"), source(write, "new_msgs")])


@pytest.mark.usefixtures("installed")
def test_what_was_compiled_against_another_build_is_named(write: Write) -> None:
    both = [source(write, "built_msgs"), source(write, "upon_msgs")]
    assert left_behind(both[:1]) == ["upon_msgs"]
    assert left_behind(both) == left_behind(both[1:]) == []
