"""What a rule is about, with a wrong and a right example; and what many examples begin with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Page:
    """The text of a rule with two trees, or for what no tree can show with two commands."""

    text: str
    wrong: str
    right: str

    @property
    def language(self) -> str:
        """What the examples are written in."""
        return "yaml" if self.wrong.startswith(("tree:", "- ")) else "sh"


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
