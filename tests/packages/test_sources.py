"""What is read of an interface package, and what is refused before anything is compiled."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.packages import PackageError
from bt_actions.packages.sources import read_package
from tests.packages.conftest import Write

pytest.importorskip("rosidl_adapter")

ACTION = "int32 a\n---\n---\n"


def refused(folder: Path) -> str:
    with pytest.raises(PackageError) as raised:
        read_package(folder)
    text = str(raised.value)
    assert len(text.splitlines()) == 1
    return text.replace(f"{folder}/", "").replace(str(folder), "FOLDER")


def test_a_package_is_what_its_files_say(write: Write) -> None:
    source = read_package(
        write(
            "my_msgs",
            {
                "action/Do.action": "nav_msgs/Path path # all of it\n---\nuint8 NO=1\n---\nA[] a\n",
                "msg/A.msg": '# of ours\nstring<=5 text "a b"\nfloat64[3] size\n',
            },
            version="1.2.3",
            depends="rclcpp nav_msgs",
        )
    )
    assert str(source) == "my_msgs 1.2.3"
    assert source.files == ("action/Do.action", "msg/A.msg")
    uses = {used: place.rpartition("/")[2] for used, place in source.uses.items()}
    assert uses == {"nav_msgs/Path": "Do.action:1", "my_msgs/A": "Do.action:5"}
    assert source.depends == {"rclcpp", "nav_msgs"}


@pytest.mark.parametrize(
    ("cmake", "files"),
    [
        ('rosidl_generate_interfaces(x "msg/A.msg")', ("msg/A.msg",)),
        ('set(all\n msg/A.msg # "msg/B.msg"\n)', ("msg/A.msg",)),
        ("file(GLOB all msg/*.msg)", ("msg/A.msg", "msg/B.msg")),
        ("", ("msg/A.msg", "msg/B.msg")),
    ],
)
def test_the_files_are_those_that_cmake_names_or_all(
    cmake: str, files: tuple[str, ...], write: Write
) -> None:
    both = {"msg/A.msg": "int32 a\n", "msg/B.msg": "int32 b\n", "msg/README.md": ""}
    assert read_package(write("my_msgs", both, cmake=cmake)).files == files


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("action/Do.action", "int32 a\n---\n", "action/Do.action: it has 1 line ---, and"),
        ("srv/Do.srv", "int32 a\n", "srv/Do.srv: it has no lines ---, and a .srv file has 1"),
        ("msg/Do.msg", "int32 a\n---\n", "msg/Do.msg: it has 1 line ---, and a .msg file has none"),
        ("msg/Do.msg", "# a\n\nint32\n", "msg/Do.msg:3: 'int32' has a type and no name"),
        ("msg/Do.msg", "\n  # fine\n  int32 a\n", "msg/Do.msg:3: a field begins its line"),
        ("msg/Do.msg", "int32 Wrong\n", "msg/Do.msg:1: 'Wrong' is an invalid field name"),
        ("msg/Do.msg", "int33 a\n", "msg/Do.msg:1: 'int33' is an invalid message name"),
        ("msg/Do.msg", "uint8 A=300\n", "msg/Do.msg:1: value '300' can not be converted"),
        ("msg/Do.msg", "int32[<=x] a\n", "msg/Do.msg:1: "),
        ("msg/Do.msg", "int32 a\nint8 a\n", "msg/Do.msg:2: 'a' is there twice"),
        ("action/do_it.action", ACTION, "action/do_it.action: 'do_it' is no name of an interface"),
        ('msg/A").idl', "module a {};", "msg/A\").idl: 'A\")' is no name of an interface"),
    ],
)  # fmt: skip
def test_a_broken_file_is_refused_with_its_line(
    file: str, text: str, message: str, write: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refused(write("my_msgs", {file: text})).startswith(message)
    assert capsys.readouterr() == ("", "")


def test_a_message_that_holds_itself_is_refused(write: Write) -> None:
    assert refused(write("my_msgs", {"msg/A.msg": "A[] below\n"})) == (
        "FOLDER: a message cannot hold itself: my_msgs/A holds my_msgs/A"
    )
    both = {"msg/A.msg": "B b\n", "msg/B.msg": "other_msgs/C c\nb_msgs/A[] a\n"}
    assert "cannot hold itself: b_msgs/" in refused(write("b_msgs", both))


def test_a_name_may_be_in_the_goal_and_in_the_result(write: Write) -> None:
    read_package(write("my_msgs", {"action/Do.action": "int32 a\n---\nint32 a\n---\nint32 a\n"}))


def test_what_is_no_interface_package_is_refused(write: Write, tmp_path: Path) -> None:
    one = {"msg/A.msg": "int32 a\n"}
    assert refused(tmp_path / "none") == "FOLDER is no folder"
    write("in_it", one)
    assert refused(tmp_path / "src") == (
        "FOLDER is no package: it has no package.xml; name one of those in it: in_it"
    )
    assert "is no interface package" in refused(write("other", {"README.md": ""}, cmake=""))
    assert refused(write("Other", one)).startswith("package.xml: <name> is 'Other'")
    assert refused(write("a__b", one)).startswith("package.xml: <name> is 'a__b'")
    assert refused(write("b_msgs", one, version="1.0")).startswith("package.xml: <version> is")
    missing = write("c_msgs", one, cmake='x("msg/A.msg" "msg/B.msg")')
    assert refused(missing) == "CMakeLists.txt names msg/B.msg, and there is no such file"
    (missing / "package.xml").write_text("<package>")
    assert refused(missing).startswith("package.xml cannot be read: ")
