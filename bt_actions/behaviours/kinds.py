"""The words for a node of a tree: its kind, and the action that it sends goals to. No ROS."""

from __future__ import annotations

import re

from py_trees import behaviours, composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.composites import Parallel, Selector, Sequence

from bt_actions.behaviours.composites import If
from bt_actions.behaviours.parallel import Parallel as OwnParallel

_WORDS = {
    composites.Sequence: "sequence",
    composites.Selector: "fallback",
    composites.Parallel: "parallel",
    decorators.Inverter: "invert",
    decorators.FailureIsSuccess: "force_success",
    decorators.SuccessIsFailure: "force_failure",
    decorators.OneShot: "run_once",
    decorators.Retry: "retry",
    decorators.Repeat: "repeat",
    decorators.Timeout: "timeout",
    behaviours.Success: "success",
    behaviours.Failure: "failure",
    behaviours.Running: "running",
}
"""The words for classes of py_trees. A class of ours has its own in `in_words`, or in its name."""


def kind(node: Behaviour) -> str:
    """Return the kind of `node`, in the words of the YAML language where it has one."""
    word = type(node).__name__
    for base in type(node).__mro__:
        if base in _WORDS:
            word = _WORDS[base]
            break
        if base.__module__.startswith("bt_actions."):
            name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", base.__name__).lower()
            word = vars(base).get("in_words", name)
            break
    if isinstance(node, Selector | Sequence | If) and not node.memory:
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
