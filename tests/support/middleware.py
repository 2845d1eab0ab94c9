"""Fast DDS's settings for the processes of the tests: loopback's UDP, and a lease.

Without shared memory: all domains of a machine share it, and a process that was killed leaves locks
and ports in it that hold up whoever comes later, in this run of the tests or in the next.
"""

from __future__ import annotations

import atexit
import functools
import shutil
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

from bt_actions.ros.environment import _PROFILES, _RANGES, PROFILE, SHORT_LEASE

LEFT_TO_THE_PROFILE = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
"""With LOCALHOST, rmw_fastrtps adds shared memory whatever the profile says."""
AS_IT_COMES = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", PROFILE: ""}
"""For the scenarios that are about Fast DDS without any settings: shared memory and all."""
NOTHING_SET = dict.fromkeys((*_RANGES, *_PROFILES), "")
"""For those that are about what our programs set for themselves where the user has set nothing."""
_NAMESPACE = "http://www.eprosima.com"
_TRANSPORT = """\
<transport_descriptors xmlns="http://www.eprosima.com">
  <transport_descriptor>
    <transport_id>loopback</transport_id>
    <type>UDPv4</type>
    <interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
  </transport_descriptor>
</transport_descriptors>
"""
_STOCK = """\
<dds xmlns="http://www.eprosima.com">
  <profiles>
    <participant profile_name="stock" is_default_profile="true"><rtps/></participant>
  </profiles>
</dds>
"""


def on_loopback(*, short_lease: bool) -> dict[str, str]:
    """Return the environment of a process with the project's short lease or Fast DDS's own."""
    return {**LEFT_TO_THE_PROFILE, PROFILE: str(_profiles() / f"{_name(short_lease)}.xml")}


def _name(short_lease: bool) -> str:
    return "short_lease" if short_lease else "stock"


@functools.cache
def _profiles() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="bt_actions-profiles-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    ET.register_namespace("", _NAMESPACE)
    for short_lease, text in ((True, SHORT_LEASE.read_text()), (False, _STOCK)):
        (folder / f"{_name(short_lease)}.xml").write_text(_kept_on_loopback(text))
    return folder


def _kept_on_loopback(profile: str) -> str:
    root = ET.fromstring(profile)
    profiles, rtps = (root.find(f".//{{{_NAMESPACE}}}{name}") for name in ("profiles", "rtps"))
    assert profiles is not None
    assert rtps is not None
    profiles.insert(0, ET.fromstring(_TRANSPORT))
    users = ET.SubElement(rtps, f"{{{_NAMESPACE}}}userTransports")
    ET.SubElement(users, f"{{{_NAMESPACE}}}transport_id").text = "loopback"
    ET.SubElement(rtps, f"{{{_NAMESPACE}}}useBuiltinTransports").text = "false"
    return ET.tostring(root, encoding="unicode", xml_declaration=True)
