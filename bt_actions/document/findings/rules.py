"""The rules a document is checked by: their codes, which never change, and how grave each is.

BT1xx is about the text, BT2xx about names and types, BT3xx about hazards. `pages.py` explains
them; a test sees to it that each has a page.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from bt_actions.document.findings import Severity


@dataclass(frozen=True, slots=True)
class Rule:
    """What a code stands for."""

    code: str
    title: str
    severity: Severity = Severity.ERROR


def _warning(code: str, title: str) -> Rule:
    return Rule(code, title, Severity.WARNING)


RULES = MappingProxyType(
    {
        rule.code: rule
        for rule in (
            Rule("BT100", "the file cannot be read"),
            Rule("BT101", "the file is no text"),
            Rule("BT102", "this is not YAML"),
            Rule("BT103", "a tab cannot indent YAML"),
            Rule("BT104", "a key is here twice"),
            Rule("BT105", "nested too deep, or too large when unfolded"),
            Rule("BT106", "the document is not a tree"),
            Rule("BT107", "unknown key"),
            Rule("BT108", "a key is missing"),
            Rule("BT109", "a value has the wrong form"),
            Rule("BT110", "a value is out of its range"),
            Rule("BT111", "a node without a kind"),
            Rule("BT112", "a node with two kinds"),
            Rule("BT113", "a name that cannot be used"),
            Rule("BT114", "this is not an expression"),
            Rule("BT115", "a dollar sign that refers to nothing"),
            _warning("BT116", "a text was cut by '#'"),
            Rule("BT117", "{x} is a mapping"),
            Rule("BT118", "[ or { ends a text inside { } and [ ]"),
            Rule("BT119", "an ignore that names no rule"),
            Rule("BT120", "an ignore that silences nothing"),
            Rule("BT121", "a name that ROS does not take"),
            Rule("BT201", "unknown kind or action"),
            Rule("BT202", "unknown variable"),
            Rule("BT203", "a message has no such field"),
            Rule("BT204", "a value does not fit its type"),
            Rule("BT205", "a type is not installed"),
            Rule("BT206", "an expression does not fit its types"),
            Rule("BT207", "unknown type"),
            Rule("BT208", "an action's name hides a kind or a key of nodes"),
            Rule("BT209", "a tree that is included cannot be read"),
            Rule("BT210", "a tree that includes itself"),
            Rule("BT211", "an input is missing"),
            Rule("BT212", "unknown input"),
            Rule("BT213", "unknown output"),
            Rule("BT214", "a class cannot be used as a behaviour"),
            Rule("BT215", "arguments do not fit"),
            Rule("BT216", "a name is declared twice"),
            Rule("BT217", "one name with two types"),
            _warning("BT301", "no result timeout"),
            _warning("BT302", "a variable is read before anything writes it"),
            _warning("BT303", "two parallel branches need one resource"),
            _warning("BT304", "a loop without a limit"),
            _warning("BT305", "a child that is never reached"),
            _warning("BT306", "a reactive composite starts what takes time again"),
            _warning("BT307", "a timeout shorter than what it holds"),
            _warning("BT308", "an input that nothing uses"),
            _warning("BT309", "an action or a topic that nothing uses"),
            _warning("BT310", "a variable that nothing reads"),
            _warning("BT311", "an output that nothing writes"),
            _warning("BT312", "a loop's item under a name that is taken"),
            _warning("BT313", "a key that not every item has"),
            _warning("BT314", "an inverted check of what nobody may know"),
            _warning("BT315", "a text that holds a variable's name"),
            _warning("BT316", "a timer that goes by the wall clock"),
            _warning("BT317", "a long duration without a unit"),
            _warning("BT318", "a large angle without a unit"),
            _warning("BT319", "a name that holds a variable"),
            _warning("BT320", "a branch that fails for the same missing value"),
            _warning("BT321", "a comparison with what a field never holds"),
            _warning("BT322", "a text in typographic quotes"),
        )
    }
)
"""Every rule by its code."""
