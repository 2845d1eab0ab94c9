"""Settings of the middleware: ours where the user has none."""

import ast
import mmap
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bt_actions import cli
from bt_actions.cli.program import COMMANDS
from bt_actions.ros import environment
from bt_actions.ros.environment import (
    SHORT_LEASE,
    Reach,
    of_other_users,
    prepare,
    sees_nobody_else,
)
from tests.support.middleware import on_loopback


@pytest.fixture(autouse=True)
def _clean(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in (
        "FASTRTPS_DEFAULT_PROFILES_FILE",
        "FASTDDS_DEFAULT_PROFILES_FILE",
        "ROS_AUTOMATIC_DISCOVERY_RANGE",
        "ROS_LOCALHOST_ONLY",
        "ROS_STATIC_PEERS",
        "FASTDDS_BUILTIN_TRANSPORTS",
    ):
        monkeypatch.setenv(name, "")  # so that it is as it was afterwards
    monkeypatch.delenv("FASTDDS_BUILTIN_TRANSPORTS")
    monkeypatch.chdir(tmp_path)


def _get(name: str) -> str:
    return os.environ.get(name, "")


def test_the_short_lease_is_given_where_the_user_has_no_profile() -> None:
    prepare()
    assert _get("FASTRTPS_DEFAULT_PROFILES_FILE") == str(SHORT_LEASE)
    assert SHORT_LEASE.exists()
    assert _get("FASTDDS_BUILTIN_TRANSPORTS") == "UDPv4"


@pytest.mark.parametrize("profile", ["", "/theirs.xml"])
@pytest.mark.parametrize("words", ["run t", "run t --sim", "send s T", "sim", "cleanup"])
def test_each_of_our_programs_has_the_short_lease_before_it_does_anything(
    words: str, profile: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless the user has given it another."""
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", profile)
    given = list[str]()
    command = words.split()[0]
    monkeypatch.setattr(
        f"bt_actions.cli.commands.{COMMANDS[command]}.run",
        lambda _: given.append(_get("FASTRTPS_DEFAULT_PROFILES_FILE")) or 0,
    )
    assert cli.main(words.split()) == 0
    assert given == [profile or str(SHORT_LEASE)]


def test_transports_that_the_user_chose_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA")
    prepare()
    assert _get("FASTDDS_BUILTIN_TRANSPORTS") == "LARGE_DATA"


@pytest.mark.parametrize("reach", Reach)
def test_only_a_private_process_sees_nobody_else(
    reach: Reach, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    prepare(reach)
    assert sees_nobody_else() is (reach is Reach.PROCESS)


@pytest.mark.parametrize("prepared", [True, False])
def test_a_process_that_is_prepared_keeps_out_of_the_shared_memory(
    prepared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    program = (
        "import pathlib, rclpy\n"
        "from bt_actions.ros.environment import prepare\n"
        f"prepare() if {prepared} else None\n"
        "rclpy.init()\n"
        "node = rclpy.create_node('looks')\n"
        "print('/dev/shm/fastrtps' in pathlib.Path('/proc/self/maps').read_text())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    )
    assert done.stdout.split()[-1] == str(not prepared)


@pytest.mark.parametrize("short_lease", [True, False])
def test_the_processes_of_these_tests_have_loopback_alone(short_lease: bool) -> None:
    program = (
        "import os, pathlib, rclpy\n"
        "rclpy.init()\n"
        "node = rclpy.create_node('looks')\n"
        "print('/dev/shm/fastrtps' in pathlib.Path('/proc/self/maps').read_text())\n"
        "ours = {os.readlink(file) for file in pathlib.Path('/proc/self/fd').iterdir()\n"
        "        if file.is_symlink()}\n"
        "lines = pathlib.Path('/proc/net/udp').read_text().splitlines()[1:]\n"
        "print({line.split()[1][:8] for line in lines if f'socket:[{line.split()[9]}]' in ours})\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | on_loopback(short_lease=short_lease) | {"ROS_DOMAIN_ID": "69"},
        check=True,
        capture_output=True,
        text=True,
    )
    in_shared_memory, addresses = done.stdout.splitlines()
    assert in_shared_memory == "False"
    assert ast.literal_eval(addresses) <= {"0100007F", "0100FFEF"}  # 127.0.0.1, 239.255.0.1


@pytest.mark.parametrize(
    "name", ["FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"]
)
def test_a_profile_of_the_user_is_never_overridden(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, "/theirs.xml")
    prepare()
    assert _get(name) == "/theirs.xml"
    assert _get("FASTDDS_BUILTIN_TRANSPORTS") == ""
    assert str(SHORT_LEASE) not in (
        _get("FASTRTPS_DEFAULT_PROFILES_FILE"),
        _get("FASTDDS_DEFAULT_PROFILES_FILE"),
    )


def test_a_profile_in_the_working_directory_is_the_users_too(tmp_path: Path) -> None:
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text("<dds/>")
    prepare()
    assert _get("FASTRTPS_DEFAULT_PROFILES_FILE") == ""


def test_a_simulation_stays_on_this_machine_and_nothing_else_does() -> None:
    prepare()
    assert _get("ROS_AUTOMATIC_DISCOVERY_RANGE") == ""
    prepare(Reach.MACHINE)
    assert _get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST"


def test_a_range_that_the_user_chose_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    prepare(Reach.MACHINE)
    assert _get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "SUBNET"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
        ("ROS_LOCALHOST_ONLY", "1"),
        ("ROS_STATIC_PEERS", "127.0.0.1"),
    ],
)
def test_a_private_simulation_is_private_whatever_was_chosen(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(name, value)
    prepare(Reach.PROCESS)
    assert {each: _get(each) for each in ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")} == {
        "ROS_LOCALHOST_ONLY": "",
        "ROS_STATIC_PEERS": "",
    }
    assert _get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "OFF"


@pytest.mark.parametrize(
    ("uses_memory", "anothers", "hint"),
    [(True, True, True), (True, False, False), (False, True, False)],
)
def test_memory_of_another_user_is_a_hint_to_who_shares_memory(
    uses_memory: bool, anothers: bool, hint: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    segment = tmp_path / "fastrtps_port7000"
    segment.write_bytes(b"x")
    monkeypatch.setattr(environment, "SHARED", str(tmp_path))
    if anothers:
        monkeypatch.setattr(os, "getuid", lambda: segment.stat().st_uid + 1)
    with segment.open("rb") as file:
        mapped = mmap.mmap(file.fileno() if uses_memory else -1, 1, access=mmap.ACCESS_READ)
        assert ("another user's" in of_other_users()) is hint
        mapped.close()
