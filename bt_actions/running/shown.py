"""The view of ROS on a run beside its goals: inputs as parameters, and the run's life on `/rosout`.

No function here prints. wiring.py is the only door to ROS.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour

from bt_actions import wiring
from bt_actions.document import given_inputs
from bt_actions.document.language.types import parse_type
from bt_actions.events import Event, RunBegan
from bt_actions.story.state import State
from bt_actions.story.why import why_text
from bt_actions.story.words import begins_text, judged, verdict

if TYPE_CHECKING:
    from bt_actions.running.runner import TreeRunner


class ShownRun:
    """The view of one run on its node, until the runner is shut down."""

    def __init__(self, runner: TreeRunner, root: Behaviour) -> None:
        self._runner = runner
        self._state = State()  # its own: the main thread reads the views'
        self._once = threading.Lock()
        for name, (each, value) in given_inputs(root).items():
            if each.secret:  # a parameter is readable by all
                continue
            unit = f" ({each.unit})" if each.unit else ""
            kind = parse_type(each.type)
            description = f"{each.description}{unit}".strip()
            given_as = runner.node, name, kind, value, description
            if kind is not None and not wiring.declare_input(*given_as):
                wiring.log().warning(
                    f"the input {name!r} is shown as no parameter of the node: ROS has one of that "
                    "name; its value is the tree's all the same"
                )
        self._rosout = wiring.rosout(runner.node)
        runner.observe_events(self._told)
        runner.on_close(self.close)

    def _told(self, event: Event) -> None:
        self._state.fold(event)
        if isinstance(event, RunBegan):
            file = event.nodes[0].place.rsplit(":", 2)[0]
            self._rosout.say("info", f"{event.tree} {begins_text(file, event.inputs)}")

    def close(self, *, left: bool = False) -> None:
        """Say how the run has ended.

        `left`: without a wait for its goals. A second call does nothing.
        """
        if not self._once.acquire(blocking=False):
            return
        state, name, unaccounted = self._state, self._state.tree, self._runner.unaccounted
        if state.began is not None:
            failed = state.finished is not None and (state.finished.error or state.failures)
            if failed:
                self._rosout.say("error", f"{name}: {why_text(state)}")
            for goal in unaccounted:
                self._rosout.say("error", f"{name}: not accounted for: {goal}")
            text = f"{name} ends: {verdict(judged(state), state.elapsed)}"
            text += ", left without waiting for its goals" if left else ""
            wrong = left or failed or unaccounted or state.finished is None
            self._rosout.say("error" if wrong else "info", text)
        self._rosout.close()
