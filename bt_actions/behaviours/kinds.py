"""What a node of a tree is, in words: its kind, and the action that it sends goals to. No ROS."""

from __future__ import annotations

import re

from py_trees.behaviour import Behaviour
from py_trees.composites import Parallel, Selector, Sequence

from bt_actions.behaviours.parallel import Parallel as OwnParallel

_WORDS = {
    "Sequence": "sequence",
    "Selector": "fallback",
    "Parallel": "parallel",
    "Inverter": "invert",
    "FailureIsSuccess": "force_success",
    "SuccessIsFailure": "force_failure",
    "OneShot": "run_once",
    "Retry": "retry",
    "Repeat": "repeat",
    "Timeout": "timeout",
    "Success": "success",
    "Failure": "failure",
    "Running": "running",
    "ActionBehaviour": "action",
    "CallService": "service",
    "RunTree": "run_tree",
    "Deadline": "timeout",
    "RetryChild": "retry",
    "SetValues": "set",
}


def kind(node: Behaviour) -> str:
    """Return what `node` is, in the words of the YAML language where it has one."""
    word = type(node).__name__
    for base in type(node).__mro__:
        if base.__name__ in _WORDS and base.__module__.startswith(("py_trees.", "bt_actions.")):
            word = _WORDS[base.__name__]
            break
        if base.__module__.startswith("bt_actions."):
            word = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", base.__name__).lower()
            break
    if isinstance(node, Selector | Sequence) and not node.memory:
        return f"reactive {word}"
    if isinstance(node, OwnParallel):
        some = "one" if node.at_least == 1 else f"at least {node.at_least}"
        return f"{word}, {'all' if node.at_least is None else some}"
    if isinstance(node, Parallel):
        policy = type(node.policy).__name__.removeprefix("SuccessOn").lower()
        return f"{word}, {policy}"
    return word


def action_of(node: Behaviour) -> tuple[str, str] | None:
    """Return server and short type name of an action leaf, None for any other node."""
    server = getattr(node, "server", None)
    action_type = getattr(node, "action_type", None)
    if not isinstance(server, str) or action_type is None:
        return None
    name = action_type if isinstance(action_type, str) else getattr(action_type, "__name__", "")
    return server, str(name).rsplit("/", 1)[-1]
