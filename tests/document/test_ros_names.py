"""The names that a tree may use are those that ROS takes: rclpy itself is asked."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rclpy.action import ActionClient
from rclpy.exceptions import NameValidationException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.validate_full_topic_name import validate_full_topic_name
from robot_control_interfaces.action import MoveRobot

from bt_actions.document.language.ros_names import LONGEST, LONGEST_NAMESPACE, RosName
from bt_actions.document.language.values import BAD
from bt_actions.document.reading.tree import join_names
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.source import Source

PIECES = ["a", "Z", "_", "0", "/", "~", "{node}", "{ns}", "{x}", "{", "}", "-", " ", ".", "é"]


def taken_by_rcl(name: str) -> bool:
    try:
        validate_full_topic_name(expand_topic_name(name, "node", "/space"))
    except (NameValidationException, ValueError):
        return False
    return True


def taken(name: str) -> bool:
    source = Source("t", f'"{name}"')
    node = compose(source)
    assert node is not None
    return RosName("the name of a topic").read(node, source) is not BAD


@given(st.lists(st.sampled_from(PIECES), max_size=6).map("".join))
@example("~")
@example("~/a")
@example("/")
@example("a/{node}0")
@settings(max_examples=100, deadline=None, derandomize=True)
def test_a_name_is_taken_exactly_when_ros_takes_it(name: str) -> None:
    # rcl makes '/space/nodea' of '~a', which its own rules forbid; {ns} holds slashes of its own.
    if "{ns}" not in name and not re.match("~[^/]", name):
        assert taken(name) == taken_by_rcl(name), name


def test_the_longest_name_in_the_longest_namespace_can_be_an_action(node: Any) -> None:
    name = f"/{'n' * (LONGEST_NAMESPACE - 1)}/{'a' * LONGEST}"
    assert taken(name[-LONGEST:])
    assert not taken("a" * (LONGEST + 1))
    ActionClient(node, MoveRobot, name).destroy()


@pytest.mark.parametrize(
    ("parts", "whole"),
    [
        (("cell", "arm", "grip"), "cell/arm/grip"), (("cell/", "grip"), "cell/grip"),
        (("cell", "/grip"), "/grip"), (("cell", "~/grip"), "~/grip"), (("/", "grip"), "/grip"),
    ],
)  # fmt: skip
def test_a_namespace_goes_before_relative_names(parts: tuple[str, ...], whole: str) -> None:
    assert join_names(*parts) == whole
