"""Nodes of our own. The node of a run gets a valid name that no other node has, as far as is seen.

A node cannot be renamed, and a participant sees the graph bit by bit. So the context is opened
before its node is needed, and the graph seen by then counts; nobody waits for more.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import socket
import sys
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from rclpy.context import Context
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.parameter import Parameter

from bt_actions.ros.environment import keep_log
from bt_actions.ros.log import log
from bt_actions.ros.workarounds import participant

SEND_GOAL = "/_action/send_goal"
"""The end of the name of an action's service for goals."""
LONGEST = 100
"""Characters of a node's name, which begins the names of its services."""


def overrides(node: Node) -> dict[str, Parameter]:
    """Return the parameters that ROS arguments give a node, by name."""
    with node.handle:
        return dict(node.handle.get_parameters(Parameter))


def where(node: Node) -> dict[str, str]:
    """Return the full name of a node, its domain, and the name of this computer."""
    domain = node.context.get_domain_id()
    name = node.get_fully_qualified_name()
    return {"node": name, "domain": str(domain), "host": socket.gethostname()}


def node_name(tree: str) -> str:
    """Return a name for a node: `bt_actions_` and the name of a tree.

    Letters with marks lose them; others become ``u`` and their code point, as in ``u90e8``.
    """
    chars = itertools.filterfalse(unicodedata.combining, unicodedata.normalize("NFKD", tree))
    plain = (f"u{ord(each):x}" if each.isalnum() and not each.isascii() else each for each in chars)
    return re.sub(r"\W", "_", f"bt_actions_{''.join(plain)}")[:LONGEST]


def open_context(
    context: Context, words: Sequence[str] | None = None, domain: int | None = None
) -> None:
    """Initialise a context with these words, or with the program's; raises what rclpy raises.

    A byte that is no UTF-8, as in names of files, is escaped: rclpy reads all words.
    """
    keep_log()
    words = sys.argv if words is None else words
    legible = [word.encode(errors="backslashreplace").decode() for word in words]
    try:
        context.init(args=legible, domain_id=domain)
    except RuntimeError as error:
        if "initialize logging" not in str(error):
            raise
        remedy = "set ROS_LOG_DIR to a folder that can be written"
        raise RuntimeError(f"the log cannot be written; {remedy}") from error


def own_node(
    name: str, *, args: list[str] | None = None, domain: int | None = None, **given: Any
) -> Node:
    """Return a node in a context of its own, without services; raises what rclpy raises."""
    context = Context()
    try:
        open_context(context, args, domain)
        return Node(
            name, context=context, enable_rosout=False, start_parameter_services=False, **given
        )
    except BaseException:
        context.try_shutdown()
        raise


@contextlib.contextmanager
def passing_node(name: str, **given: Any) -> Iterator[Node]:
    """Yield a node as `own_node` makes it, and take it away afterwards."""
    node = own_node(name, **given)
    try:
        yield node
    finally:
        participant.close(node)


def server_name(node: Node, action: str) -> str:
    """Return the full name of the server that a node's goals for an action go to.

    ROS remaps no action, but its parts: the service that takes goals says which server it is.
    Raises ValueError for a name that ROS refuses.
    """
    name: str = expand_topic_name(action, node.get_name(), node.get_namespace())
    service: str = node.resolve_service_name(name + SEND_GOAL)
    return service.removesuffix(SEND_GOAL) if service.endswith(SEND_GOAL) else name


def server_names(actions: Iterable[str], name: str, namespace: str = "") -> list[str]:
    """Return the servers that a node to come has for actions; a second node is there for a moment.

    `name` and `namespace` are the first node's, before remapping. Raises what rclpy raises.
    """
    with passing_node(name, namespace=namespace) as node:
        return sorted({server_name(node, each) for each in actions})


def warn_of_remapping(node: Node, action: str) -> None:
    """Warn of a rule that would give an action another full name: ROS remaps no action."""
    name: str = expand_topic_name(action, node.get_name(), node.get_namespace())
    other, part = node.resolve_service_name(name), name + SEND_GOAL
    if other != name and node.resolve_service_name(part) == part:
        log.warning(
            f"a rule remaps {name} to {other}, and has no effect: ROS does not remap actions. "
            f"Name {other} itself, set the namespace of the node, or remap its parts: {part}, "
            "cancel_goal, get_result, feedback and status"
        )


class Outlook:
    """A context of our own that looks at the graph before its node is made."""

    def __init__(self) -> None:
        """Open the context. Raises what rclpy raises where ROS cannot start."""
        self._node = own_node(f"bt_actions_{os.getpid()}_outlook", use_global_arguments=False)
        self.context: Context = self._node.context

    def hand_over(self) -> None:
        """Leave the context to the node that was made in it."""
        self._node.destroy_node()

    def close(self) -> None:
        """Take the context away, where it was not handed over."""
        participant.close(self._node)


def named_node(name: str, context: Context, namespace: str) -> Node:
    """Return a new node; a number follows its name where another node is seen to have the name.

    A name given by ``__node:=`` stands as it is. Both cases give a warning. Parameters are those
    of the name without a number.
    """
    wanted, taken, given = name, "", list[Parameter]()
    for number in itertools.count(2):
        node = Node(name, context=context, namespace=namespace, parameter_overrides=given)
        ours = node.get_fully_qualified_name()
        if taken:
            log.warning(
                f"another node is called {taken}: this one is {ours}; "
                "--ros-args -r __node:=NAME gives another"
            )
        mine = node.get_name(), node.get_namespace()
        if node.get_node_names_and_namespaces().count(mine) < 2:
            break
        if mine[0] != name:
            log.warning(
                f"another node is called {ours}, too, as __node:= has it: "
                "others may reach one or the other"
            )
            break
        taken, ending = ours, f"_{number}"
        given = given or list(overrides(node).values())
        node.destroy_node()
        name = wanted[: LONGEST - len(ending)] + ending
    return node
