"""The form of ROS names: of topics, servers and namespaces, as `rcl` takes them.

The rules are those of `rcl_validate_topic_name` and `rmw_validate_full_topic_name`. This file has
them, too, so that a tree is found wrong before it runs, and without ROS.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from bt_actions.document.language.scalars import Schema, wrong_form
from bt_actions.document.language.values import BAD
from bt_actions.document.yaml.mistaken import warn_cut
from bt_actions.document.yaml.nodes import Node, Scalar, span_of
from bt_actions.document.yaml.source import Source

LONGEST = 120
LONGEST_NAMESPACE = 100
"""Characters. ROS allows 247 for namespace and name, with the 20 that an action adds to them."""

_PART = r"(?:[A-Za-z0-9_]|\{(?:node|ns|namespace)\})"
_TOKEN = rf"(?![0-9]){_PART}+"
_NAME = rf"(?:~|(?:~/|/)?{_TOKEN}(?:/{_TOKEN})*)"
_NAMESPACE = rf"(?:{_NAME})?/?"
INPUT = re.compile(r"\$\(([A-Za-z][A-Za-z0-9_]*)\)")
"""An input in a name."""
_STRANGE = re.compile(r"[^A-Za-z0-9_/~{}]")
_BRACES = re.compile(r"\{[^{}]*\}?|\}")


@dataclass(frozen=True, slots=True)
class RosName:
    """A name that ROS takes; a `namespace` may be empty, and end with a slash.

    Inputs of the tree may stand in the name as `$(name)`: their values come in when a tree is made.
    """

    words: str
    namespace: bool = False

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar) or not isinstance(node.value, str):
            return wrong_form(self, node, source)
        written = INPUT.sub("x", node.text)
        if re.fullmatch(self._pattern, written) and len(written) <= self._longest:
            warn_cut(node, source, "text")
            return node.text
        hint = "letters, digits and underscores between slashes, such as arm/gripper"
        said = f"{node.text!r} cannot be {self.words}: {_why(written, self._longest)}"
        source.report("BT121", span_of(node), said, hint=hint)
        return BAD

    def schema(self) -> Schema:
        names = {"pattern": f"^{self._pattern}$", "maxLength": self._longest}
        return {"type": "string", "anyOf": [names, {"pattern": INPUT.pattern}]}

    @property
    def _pattern(self) -> str:
        return _NAMESPACE if self.namespace else _NAME

    @property
    def _longest(self) -> int:
        return LONGEST_NAMESPACE if self.namespace else LONGEST


def why_not(name: str) -> str:
    """Say what keeps a text from being the name of a topic or server; "" for nothing."""
    return "" if re.fullmatch(_NAME, name) and len(name) <= LONGEST else _why(name, LONGEST)


def _why(text: str, longest: int) -> str:
    """Say what ROS would refuse in a name."""
    if not text:
        return "it is empty"
    if len(text) > longest:
        return f"it has more than {longest} characters"
    if "$" in text:
        return "an input stands in it as $(name)"
    strange = _STRANGE.search(text)
    if strange is not None:
        return "a space cannot stand in it" if strange[0] == " " else f"{strange[0]!r} is in it"
    if "//" in text:
        return "two slashes stand together"
    if text.endswith("/"):
        return "it ends with a slash"
    if "~" in text[1:] or re.match(r"~[^/]", text):
        return "'~' stands only at its beginning, before a slash"
    for braces in _BRACES.findall(text):
        if braces not in ("{node}", "{ns}", "{namespace}"):
            return f"{braces!r} is not {{node}}, {{ns}} or {{namespace}}"
    return "a part of it begins with a digit"
