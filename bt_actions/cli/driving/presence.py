"""What ROS sees of a run beside its goals: its inputs as parameters, and its life on `/rosout`.

What it says is also what the run prints, so nothing here prints anything but a warning.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.cli.streams.writing import note
from bt_actions.cli.views.table import summary
from bt_actions.cli.views.words import brief
from bt_actions.document import given_inputs, place_of, tree_name
from bt_actions.events import Event, TreeStarted
from bt_actions.running.report import Report
from bt_actions.utilities.plain_text import clean, in_words

if TYPE_CHECKING:
    from bt_actions.running.runner import TreeRunner


class Presence:
    """Shows one run on its node, which `close` has to find alive."""

    def __init__(self, runner: TreeRunner, root: Behaviour) -> None:
        from bt_actions.document.language.types import parse_type
        from bt_actions.ros.parameters import declare_input
        from bt_actions.ros.rosout import Rosout

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
            if kind is not None and not declare_input(runner.node, name, kind, value, description):
                note(f"bt-actions: the input {name!r} is shown as no parameter of the node: ROS has"
                     " one of that name; --set gives it a value")  # fmt: skip
        self._rosout = Rosout(runner.node)
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
        failed = "\n".join(summary(self._report)) if error is None else in_words(error)
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
