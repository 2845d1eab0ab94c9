"""What ROS sees of a run beside its goals: its inputs as parameters, and its life on `/rosout`.

What is said on `/rosout` is printed by nothing here. Knows ROS by wiring.py alone.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions import wiring
from bt_actions.document import given_inputs, place_of, tree_name
from bt_actions.document.language.types import parse_type
from bt_actions.events import Event, TreeStarted
from bt_actions.running.report import Report
from bt_actions.utilities.plain_text import clean, in_words
from bt_actions.utilities.shorten import brief

if TYPE_CHECKING:
    from bt_actions.running.runner import TreeRunner


class ShownRun:
    """Shows one run on its node, which `close` has to find alive."""

    def __init__(self, runner: TreeRunner, root: Behaviour) -> None:
        self._runner = runner
        self._report = Report(root)  # of its own: the views' is read on the main thread
        self._name = tree_name(root)
        self._begun = self._closed = False
        self._once = threading.Lock()
        given = given_inputs(root)
        words = [f"{name}={brief(value)}" for name, (_, value) in given.items()]
        place = place_of(root)
        where = f" ({place.file})" if place else ""
        what = f"{self._name}{where} begins{' with ' if words else ''}{', '.join(words)}"
        self._begins = clean(brief(what))
        for name, (each, value) in given.items():
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
        runner.observe(self._observe)

    def _observe(self, event: Event) -> None:
        self._report.observe(event)
        if isinstance(event, TreeStarted):
            self._begun = True
            self._rosout.say("info", self._begins)

    def close(self, *, left: bool = False, error: BaseException | None = None) -> None:
        """Say how the run has ended; `left`: without waiting for its goals. Once is enough."""
        with self._once:
            if self._closed:
                return
            self._closed = True
        if not self._begun:
            self._rosout.close()
            return
        status = self._report.status
        failed = "\n".join(self._report.summary()) if error is None else in_words(error)
        if failed:
            self._rosout.say("error", f"{self._name}: {failed}")
        word = status.value if status is not Status.INVALID else "STOPPED"
        unaccounted = self._runner.unaccounted
        for goal in unaccounted:
            self._rosout.say("error", f"{self._name}: not accounted for: {goal}")
        text = f"{self._name} ends: {word} after {self._report.elapsed():.2f} s"
        text += ", left without waiting for its goals" if left else ""
        wrong = left or unaccounted or failed or status is Status.FAILURE
        self._rosout.say("error" if wrong else "info", text)
        self._rosout.close()
