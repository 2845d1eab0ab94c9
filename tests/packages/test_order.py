"""Which packages are built, in which order; what is missing is named."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from bt_actions.packages import PackageError
from bt_actions.packages.order import in_order
from tests.packages.conftest import Write

pytest.importorskip("rosidl_adapter")


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """A prefix in which geometry_msgs is installed for building upon, and bare_msgs is not."""
    prefix = tmp_path / "prefix"
    for package in ("geometry_msgs", "bare_msgs"):
        (prefix / "share" / package / "msg").mkdir(parents=True)
        (prefix / "share" / package / "msg" / "Pose.idl").touch()
    (prefix / "share" / "geometry_msgs" / "cmake").mkdir()
    return prefix


def names(folders: list[Path], prefix: Path) -> list[str]:
    return [source.name for source in in_order(folders, [prefix])]


def refused(folders: list[Path], prefix: Path) -> str:
    with pytest.raises(PackageError) as raised:
        in_order(folders, [prefix])
    return str(raised.value)


def test_each_package_comes_after_those_that_it_uses(write: Write, prefix: Path) -> None:
    first = write("z_msgs", {"msg/A.msg": "geometry_msgs/Pose pose\n"})
    second = write("m_msgs", {"msg/B.msg": "z_msgs/A a\n"})
    third = write("a_msgs", {"msg/C.msg": "m_msgs/B b\nz_msgs/A a\n"})
    assert names([third, second, first], prefix) == ["z_msgs", "m_msgs", "a_msgs"]


def test_what_lies_beside_is_built_too_where_it_is_used_and_not_installed(
    write: Write, prefix: Path
) -> None:
    write("z_msgs", {"msg/A.msg": "int32 a\n"}, folder="another_name")
    write("m_msgs", {"msg/B.msg": "z_msgs/A a\ngeometry_msgs/Pose pose\n"})
    write("geometry_msgs", {"msg/Pose.msg": "int32 a\n"})
    write("unused_msgs", {"msg/D.msg": "int32 a\n"})
    third = write("a_msgs", {"msg/C.msg": "m_msgs/B b\n"})
    assert names([third], prefix) == ["z_msgs", "m_msgs", "a_msgs"]


def test_package_xml_may_ask_for_what_no_file_uses(write: Write, prefix: Path) -> None:
    """As nav2_msgs asks for rclcpp and for macros of CMake."""
    package = write("a_msgs", {"msg/C.msg": "int32 c\n"}, depends="rclcpp nav2_common")
    assert names([package], prefix) == ["a_msgs"]


@pytest.mark.parametrize("package", ["no_msgs", "bare_msgs"])
def test_what_is_nowhere_is_named_with_its_place_and_what_to_install(
    package: str, write: Write, prefix: Path
) -> None:
    said = refused([write("a_msgs", {"msg/C.msg": f"\n{package}/Pose c\n"})], prefix)
    assert f"a_msgs/msg/C.msg:2: {package}/Pose is used, and {package} is not there" in said
    assert f"`pip install ros-jazzy-{package.replace('_', '-')}`" in said


def test_a_message_that_a_package_does_not_have_is_named(write: Write, prefix: Path) -> None:
    text = {"msg/Crate.msg": "geometry_msgs/Pos pose\n"}
    said = refused([write("a_msgs", text)], prefix)
    assert said.endswith(
        "msg/Crate.msg:1: geometry_msgs has no message 'Pos'; did you mean 'Pose'?"
    )
    own = {"msg/Crate.msg": "int32 a\n", "msg/Two.msg": "Crat a\n"}
    assert "b_msgs has no message 'Crat'" in refused([write("b_msgs", own)], prefix)


def test_a_circle_is_told_in_order(write: Write, prefix: Path) -> None:
    first = write("a_msgs", {"msg/A.msg": "b_msgs/B b\n"})
    write("b_msgs", {"msg/B.msg": "int32 a\n"}, depends="c_msgs")
    write("c_msgs", {"msg/C.msg": "a_msgs/A a\n"})
    said = refused([first, first.parent / "b_msgs", first.parent / "c_msgs"], prefix)
    assert "in a circle" in said
    circle = said.partition(": ")[2].split(" uses ")
    assert circle[0] == circle[-1]
    pairs = set(itertools.pairwise(circle))
    assert pairs == {("a_msgs", "b_msgs"), ("b_msgs", "c_msgs"), ("c_msgs", "a_msgs")}


def test_one_name_in_two_folders_is_refused(write: Write, prefix: Path) -> None:
    first = write("a_msgs", {"msg/A.msg": "int32 a\n"})
    second = write("a_msgs", {"msg/A.msg": "int32 a\n"}, folder="copy")
    assert f"a_msgs is there twice: in {first} and in {second}" == refused([first, second], prefix)
    assert names([first, first], prefix) == ["a_msgs"]
