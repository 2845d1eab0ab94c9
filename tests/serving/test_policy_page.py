"""The policy in docs/security.md names what a server of trees offers, and forgets none of ours."""

from __future__ import annotations

import contextlib
import fnmatch
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from rclpy.node import NodeNameNonExistentError

from tests.serving.conftest import Serve
from tests.support.tree_client import TreeClient

PAGE = (Path(__file__).parents[2] / "docs" / "security.md").read_text()
NODE = "bt_actions_serve"
SINCE = "/r1/run_tree/_since/*"
"""By its name other servers know since when this one is there; nobody subscribes to it."""
OURS = ("bt_actions_interfaces", "lifecycle_msgs", "diagnostic_msgs")
ACTION = ("services send_goal", "services cancel_goal", "services get_result",
          "topics feedback", "topics status")  # fmt: skip


def named(profile: ET.Element) -> set[tuple[str, str]]:
    """The services and topics that a profile names, by their full names; of actions, all five."""
    found = set()
    for group in profile:
        for each in group:
            name = re.sub("^~", f"/r1/{NODE}/", each.text or "")
            name = name if name[0] == "/" else f"/r1/{name}"
            if group.tag == "actions":
                parts = [part.split() for part in ACTION]
                found |= {(kind, f"{name}/_action/{part}") for kind, part in parts}
            else:
                found.add((group.tag, name))
    return found


def offered(client: TreeClient, space: str) -> dict[tuple[str, str], str]:
    """What the server offers, as if it were in /r1, and its type."""
    node: Any = client.node
    with contextlib.suppress(NodeNameNonExistentError):
        services = node.get_service_names_and_types_by_node(NODE, space)
        topics = node.get_publisher_names_and_types_by_node(NODE, space)
        return {
            (kind, name.replace(space, "/r1")): types[0]
            for kind, found in (("services", services), ("topics", topics))
            for name, types in found
        }
    return {}


def test_the_policy_names_what_is_offered(
    serve_trees: Serve, client: TreeClient, space: str
) -> None:
    serve_trees()
    policy = ET.fromstring(re.findall("```xml\n(.*?)```", PAGE, re.DOTALL)[0])
    server, *clients = policy.iter("profile")
    (calls,) = (group for group in server if group.get("call"))
    server.remove(calls)  # the robot's
    wanted = named(server) - {("topics", SINCE)}
    client.until(lambda: wanted <= offered(client, space).keys(), "all that is named")
    there = offered(client, space)
    assert fnmatch.filter((name for _, name in there), SINCE)
    assert ("topics", SINCE) in named(server)
    ours = {each for each, kind in there.items() if kind.startswith(OURS)}
    assert ours <= named(server)
    for each in clients:
        assert named(each) <= there.keys()
    assert set().union(*map(named, clients)) == wanted, "there is somebody for each"
