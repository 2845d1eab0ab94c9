"""The leaf that has a server of trees run a tree, on this machine or another one. No ROS here.

The life of a goal is ActionBehaviour's. This file has only the fields of a goal, and the reading of
a result of RunTree; the server's half is bt_actions/serving/.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.variables import Var, resolve
from bt_actions.events.teller import current_teller
from bt_actions.expressions.text import ExpressionError
from bt_actions.goals.policy import Outcome, Timeouts
from bt_actions.messages.conversion import to_plain
from bt_actions.messages.interfaces import RUN_TREE
from bt_actions.traffic.backend import Backend
from bt_actions.traffic.state import GoalHandle

CANCEL = 15.0
"""Seconds for a canceled run to end. The run sees its own goals to their ends first, within 5 s
each where their trees say nothing else."""


class RunTree(ActionBehaviour):
    """A leaf that has a tree run by a server of trees (`bt-actions serve`), and takes over its end.

    Where the server cannot account for every goal of the run, the end is UNKNOWN here, too,
    whatever the status. A run that failed gives its root cause as the reason.

    Args:
        name: as in py_trees.
        tree: the tree's name at the server, or a Var that holds it.
        inputs: values of the tree's inputs by their names, with Var as in a goal, or a callable
            that returns them. NaN, infinities, and integers beyond 64 bits make the goal an
            invalid one.
        server: the name of the server's action.
        goal_name: the goal's name in the server's rejection; the leaf's name where not given.
        timeout: as for any action; `cancel` is 15 s where nothing else is said.

    Other keyword arguments are those of ActionBehaviour; `expect`, `save` and `retry.when` may name
    ``outputs`` (the values of the tree's outputs, a mapping) beside ``result``: ``save={"at":
    "outputs.at"}``.
    """

    def __init__(
        self,
        name: str,
        tree: str | Var | Callable[[], object],
        inputs: Mapping[str, Any] | Callable[[], object] | None = None,
        *,
        server: str = "run_tree",
        goal_name: str = "",
        timeout: Timeouts | float | None = None,
        **kwargs: Any,
    ) -> None:
        def goal() -> dict[str, object]:
            which = tree() if callable(tree) else resolve(tree)
            values = inputs() if callable(inputs) else resolve(inputs or {})
            teller = current_teller.get()
            return {
                "tree": which,
                "inputs": inputs_text(values),
                "goal_name": goal_name or name,
                "caller_run": teller.run_id if teller is not None else "",
            }

        if not isinstance(timeout, Timeouts):
            timeout = Timeouts(result=timeout, cancel=CANCEL)
        super().__init__(name, RUN_TREE, server, goal, timeout=timeout, **kwargs)

    tells_whole_result = True

    def names(self, result: Any) -> Mapping[str, object]:
        """Return the result, and the outputs of the tree."""
        return roots_of(result)

    def settles(self, result: Any) -> bool:
        """Return whether the server accounts for every goal of the run."""
        return result is not None and bool(result.settled)

    def explain(self, outcome: Outcome, result: Any) -> str:
        """Return the run's root cause; for a rejection, the place of its reason."""
        if outcome is Outcome.REJECTED:
            return "its log, and its topic ~/rejections, say why"
        return result.error_msg.partition("\n")[0] if result is not None else ""

    def _begin(self, backend: Backend) -> GoalHandle:
        handle = super()._begin(backend)
        handle.goal.untold = ("goal_name", "caller_run")
        return handle

    def _read_result(self, result: Any) -> str:
        if not result.settled:
            return f"the run left goals whose end is not known: {result.error_msg}"
        return super()._read_result(result)


def roots_of(result: Any) -> dict[str, object]:
    """Return the names for expressions over a result; raises ExpressionError for wrong outputs."""
    try:
        outputs = json.loads(getattr(result, "outputs", "") or "{}")
    except (ValueError, RecursionError) as error:
        raise ExpressionError(f"the server's outputs are no JSON: {error}") from None
    if not isinstance(outputs, dict):
        raise ExpressionError("the server's outputs are no mapping")
    return {"result": result, "outputs": outputs}


def inputs_text(values: object) -> str:
    """Write inputs in the form of RunTree. Raises ValueError for a value that cannot be sent."""
    if not isinstance(values, Mapping):
        raise ValueError(f"inputs are a mapping of names to values, not {values!r:.40}")
    plain = to_plain(values)
    _refuse(plain, "inputs")
    return json.dumps(plain, ensure_ascii=False)


def _refuse(value: object, path: str) -> None:
    """Raise ValueError for a value that cannot be sent."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _refuse(inner, f"{path}.{key}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            _refuse(inner, f"{path}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{path} is {value}, which cannot be sent")
    elif isinstance(value, int) and not -(2**63) <= value < 2**64:
        raise ValueError(f"{path} does not fit 64 bits")
    elif not isinstance(value, str | int | float | None):
        raise ValueError(f"{path} is a {type(value).__name__}, which cannot be sent")
