"""A rule that documents are checked by; and what many of the examples begin with."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from bt_actions.document.findings import Severity


@dataclass(frozen=True, slots=True)
class Rule:
    """What a code stands for, with two trees, or for what no tree can show with two commands."""

    code: str
    title: str
    text: str
    wrong: str
    right: str
    severity: Severity = Severity.ERROR

    @property
    def language(self) -> str:
        """What the examples are written in."""
        return "yaml" if self.wrong.startswith(("tree:", "- ")) else "sh"

    def page(self) -> str:
        """All of it as plain text."""
        title = f"{self.code}: {self.title} ({self.severity})"
        parts = [title, "", textwrap.fill(self.text, 88), ""]
        for word, example in (("Wrong", self.wrong), ("Right", self.right)):
            parts += [f"{word}:", "", textwrap.indent(example.rstrip("\n"), "    "), ""]
        return "\n".join(parts)


MOVE = """\
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: move_robot
    timeout: 30 s
"""
SUCCESS = "root: {success: Done}\n"


def tree(body: str) -> str:
    return "tree: example\n" + body


def moving(body: str) -> str:
    return tree(MOVE + body)
