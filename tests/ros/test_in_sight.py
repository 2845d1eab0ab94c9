"""Why a topic or a service finds nobody, from what the graph shows: without a graph."""

from __future__ import annotations

import pytest
from rclpy.topic_endpoint_info import TopicEndpointInfo as Ends

from bt_actions.ros.connections import qos_profile
from bt_actions.ros.in_sight import mismatch
from bt_actions.utilities.suggest import elsewhere

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
