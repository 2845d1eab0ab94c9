"""One goal, watched: a line a change; on a terminal, feedback is rewritten in place."""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

from bt_actions.cli.views import words
from bt_actions.events import Event, GoalChanged
from bt_actions.goals.policy import End, Outcome
from bt_actions.running.report import Report, Row
from bt_actions.utilities.shorten import fit

if TYPE_CHECKING:
    from bt_actions.behaviours.action import ActionBehaviour


class GoalView:
    """One line a change of the goal; on a terminal, feedback is rewritten in place."""

    fileno = -1

    def __init__(
        self, report: Report, leaf: ActionBehaviour, out: TextIO, *, feedback: bool
    ) -> None:
        self._report = report
        self._leaf = leaf
        self._out = out
        self._feedback = feedback
        self._last = ""
        self._last_feedback = ""
        self._in_place = out.isatty() and feedback
        self._drawn = False

    def event(self, event: Event) -> None:
        """Write where the goal stands, when that has changed."""
        if not isinstance(event, GoalChanged):
            return
        text = words.goal_text(self._report.row(event.behaviour))
        if event.outcome is None and text != self._last:
            self._last = text
            self._line(text)

    def frame(self) -> None:
        """Show the latest feedback."""
        for row in self._report.live if self._feedback else ():
            text = self.feedback_text(row)
            if text and text != self._last_feedback:
                self._last_feedback = text
                self._show_feedback(text)

    def say(self, text: str) -> None:
        """Write `text` on a line of its own."""
        self._line(text)

    def finish(self, closing: words.Closing) -> None:
        """Write the result and the outcome."""
        for line in self.result_lines():
            self._line(line)
        for row in self._report.rows:
            if self._leaf.history:
                row.reason = self._leaf.history[-1].goal.reason  # the result was told above
            if closing.cause and row.outcome is Outcome.CANCELED:
                row.reason = closing.cause  # here is no tree that could have interrupted it
            self._line(f"{words.goal_text(row)}, after {row.seconds(self._report.now):.2f} s")
        for line in words.left_open(self._report, closing):
            self._line(line)

    def feedback_text(self, row: Row) -> str:
        """Return the latest feedback on one line."""
        return words.feedback_text(row)

    def result_lines(self) -> list[str]:
        """Return what the goal's result says."""
        if self._leaf.end not in (End.SUCCEEDED, End.ABORTED):
            return []  # only these have a result of their own
        return words.result_lines(self._leaf.result)

    def close(self) -> None:
        """Leave the line that feedback was drawn on."""
        if self._drawn:
            self._line("")

    def _show_feedback(self, text: str) -> None:
        if not self._in_place:
            self._line(f"  {text}")
            return
        self._out.write(f"\r\x1b[K  {text}")
        self._out.flush()
        self._drawn = True

    def _line(self, text: str) -> None:
        start = "\r\x1b[K" if self._drawn else ""
        self._drawn = False
        self._out.write(f"{start}{fit(text)}\n" if text else start)
        self._out.flush()
