"""Why a topic, a service or an action finds nobody, from what the graph shows."""

from __future__ import annotations

from typing import Any

import pytest
from rclpy.action import ActionServer
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo as Ends
from robot_control_interfaces.action import MoveRobot
from std_srvs.srv import SetBool

from bt_actions.ros.connections import RosService, qos_profile
from bt_actions.ros.in_sight import mismatch
from bt_actions.ros.node_participant import NodeParticipant
from bt_actions.utilities.suggest import elsewhere
from tests.support.waiting import until

BOOL = "std_msgs/msg/Bool"
OURS = Ends(topic_type=BOOL, qos_profile=qos_profile("default"))
BEST_EFFORT = Ends(topic_type=BOOL, qos_profile=qos_profile("best_effort"))
LATCHED = Ends(topic_type=BOOL, qos_profile=qos_profile("latched"))
OTHER = Ends(topic_type="std_msgs/msg/String", qos_profile=qos_profile("default"))


@pytest.mark.parametrize(
    ("ours", "others", "heard", "unheard"),
    [
        (OURS, [], "nobody publishes on it", ""),
        (OURS, [OURS], "", ""),
        (
            OURS,
            [OTHER, OTHER],
            "what is published there is std_msgs/msg/String, not std_msgs/msg/Bool",
            "what is asked for there is std_msgs/msg/String, not std_msgs/msg/Bool",
        ),
        (
            OURS,
            [OTHER, BEST_EFFORT],
            "what is published there is best effort, write 'qos: best_effort'",
            "",
        ),
        (BEST_EFFORT, [OURS], "", "what is asked for there is reliable, not best effort"),
        (OURS, [BEST_EFFORT, OURS], "", ""),
        (LATCHED, [OURS], "what is published there is not latched, write 'qos: default'", ""),
        (OURS, [LATCHED], "", "what is asked for there is latched, write 'qos: latched'"),
    ],
)
def test_what_is_there_in_vain_is_said_of_publishers_and_of_subscriptions(
    ours: Ends, others: list[Ends], heard: str, unheard: str
) -> None:
    kind, qos = ours.topic_type, ours.qos_profile
    assert mismatch(kind, qos, others, publish=True) == heard
    assert mismatch(kind, qos, others, publish=False) == unheard


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({}, ""),
        ({"/door": [BOOL]}, ""),
        ({"/l/door": [BOOL], "/r/door": [BOOL]}, "; there is /l/door, /r/door of that type"),
        (
            {f"/{number}/door": [BOOL] for number in range(5)},
            "; there is /0/door, /1/door, /2/door and 2 more of that type",
        ),
        ({"/l/door": ["std_msgs/msg/String"]}, ""),
        ({"/doors": [BOOL]}, "; did you mean '/doors'?"),
        ({"/dock": [BOOL]}, ""),
    ],
)
def test_one_of_the_same_type_in_another_namespace_is_named(
    known: dict[str, list[str]], said: str
) -> None:
    assert elsewhere("/door", BOOL, known) == said


LESS = {"best effort": QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        "volatile": QoSProfile(depth=1),
        "latched": QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)}  # fmt: skip
IN_SIGHT = ": it is in sight, but "


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"feedback_pub": "best effort"}, "its feedback is best effort, and reliable is asked for"),
        ({"status_pub": "volatile"}, "its status is volatile, and transient local is asked for"),
        (
            {"goal_service": "best effort", "cancel_service": "best effort"},
            "its send_goal service, cancel_goal service is best effort, and reliable is asked for",
        ),
        (
            {"result_service": "latched"},
            "its get_result service asks for transient local, and gets volatile",
        ),
        ({"feedback_pub": "latched"}, "was not ready, or has requests enough to answer"),
    ],
    ids=str,
)
def test_of_an_action_server_in_sight_the_policy_that_does_not_match_is_named(
    node: Any, name: str, settings: dict[str, str], said: str
) -> None:
    theirs = Node("theirs", context=node.context)
    profiles: Any = {f"{part}_qos_profile": LESS[qos] for part, qos in settings.items()}
    server = ActionServer(theirs, MoveRobot, name, lambda goal: goal, **profiles)
    participant = NodeParticipant.of(node)
    told: list[str] = []
    until(
        lambda: told[-1] == IN_SIGHT + said,
        meanwhile=lambda: told.append(participant.instead(MoveRobot, name)),
    )
    server.destroy()
    theirs.destroy_node()


def test_of_a_service_in_sight_the_policy_that_does_not_match_is_named(
    node: Any, name: str
) -> None:
    theirs = Node("theirs", context=node.context)
    theirs.create_service(SetBool, name, lambda _, answer: answer, qos_profile=LESS["best effort"])
    service = RosService(node, SetBool, name)
    said = f"{IN_SIGHT}it is best effort, and reliable is asked for"
    until(lambda: service.why_nobody() == said)
    service.close()
    theirs.destroy_node()
