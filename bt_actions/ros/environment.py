"""The middleware's settings for processes of our own; to be called before ROS is first touched.

A user's setting is never overridden, but for the reach of a simulation that is to be private.
Does not import rclpy.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterable
from enum import Enum
from pathlib import Path

SHORT_LEASE = Path(__file__).with_name("short_lease.xml")
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
_PROFILES = (PROFILE, "FASTDDS_DEFAULT_PROFILES_FILE")
SHARED = "/dev/shm"  # nosec B108
_SEGMENT = "fastrtps_"
"""The beginning of the names of Fast DDS's memory, in Linux' folder of shared memory."""
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
_IN_THIS_FOLDER = ("DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml")
_RANGES = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")


class Reach(Enum):
    """The range in which a process sees and is seen, as ROS_AUTOMATIC_DISCOVERY_RANGE has it."""

    NETWORK = ""
    MACHINE = "LOCALHOST"
    """For simulated servers: they carry the names of real ones, and would be mistaken for them."""
    PROCESS = "OFF"
    """For a tree with its own simulated servers: a tree must not take those of a real robot nearby
    for them, nor another tree these for real ones. Private whatever the user has set for robots.
    """


def sees_nobody_else() -> bool:
    """Return whether a node made now sees those of this process alone."""
    return os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == Reach.PROCESS.value


def prepare(reach: Reach = Reach.NETWORK) -> None:
    """Let others notice this process' death within 3 s, and set how far it is seen.

    Messages go over UDP alone: killed processes hold up others in Fast DDS's shared memory,
    whatever their domain (docs/reliability-settings.md). With Reach.MACHINE, rmw_fastrtps insists
    on shared memory besides.
    """
    if not _any_is_set(_PROFILES) and not any(Path(name).exists() for name in _IN_THIS_FOLDER):
        os.environ[PROFILE] = str(SHORT_LEASE)
        os.environ.setdefault(_TRANSPORTS, "UDPv4")
    if reach is Reach.PROCESS:
        for name in _RANGES:
            os.environ.pop(name, None)
    if reach is not Reach.NETWORK and not _any_is_set(_RANGES):
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = reach.value


def keep_log() -> None:
    """Put ROS's log into a temporary folder where the user's home cannot be written.

    Without a log no ROS program starts. A ROS_LOG_DIR that the user has set stands.
    """
    if _any_is_set(["ROS_LOG_DIR"]):
        return
    home = os.environ.get("ROS_HOME") or "~/.ros"
    folder = Path(os.path.expanduser(home), "log")  # noqa: PTH111 - Path's raises without a home
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    if not os.environ.get("HOME") or not os.access(folder, os.W_OK):
        with contextlib.suppress(OSError):  # then rcl says why
            os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="bt_actions-log-")


def of_other_users() -> str:
    """Say, as the end of a sentence, why a server in sight may not hear us, nor we it; or "".

    The answer is a guess: processes of another user run, and Fast DDS talks to all in shared
    memory.
    """
    with contextlib.suppress(OSError):  # one has gone meanwhile, say
        segments = [each for each in os.scandir(SHARED) if each.name.startswith(_SEGMENT)]
        others = any(each.stat().st_uid != os.getuid() for each in segments)
        if others and f"{SHARED}/{_SEGMENT}" in Path("/proc/self/maps").read_text():
            here = os.environ.get(_RANGES[0]) == Reach.MACHINE.value
            without = f", without {_RANGES[0]}=LOCALHOST" if here else ""
            return (
                "; its server may be another user's, who shares no memory with this process: "
                f"set {_TRANSPORTS}=UDPv4 for both{without}"
            )
    return ""


def _any_is_set(names: Iterable[str]) -> bool:
    return any(map(os.environ.get, names))
