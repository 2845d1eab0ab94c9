"""Bare names of variables in texts, where an author may mean their values: BT315.

Other languages write `{name}`, `{{ name }}`, `%(name)s`, `<name>` or `@name`; here that is text.
"""

from __future__ import annotations

import re
from collections.abc import Container

from bt_actions.document.language.values import computes, names_file, names_value
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source
from bt_actions.document.yaml.written import inner_span

_PATH = r"([A-Za-z]\w*(?:\.\w+)*)"
_FORMS = re.compile(
    rf"(?<!\$)\{{+\s*{_PATH}\s*(?::[^{{}}]*)?\}}+|%\({_PATH}\)[a-z]?|<{_PATH}>|(?<!\w)@{_PATH}",
    re.ASCII,
)
_SIGNS = frozenset("{%<@")
"""Characters of which each notation has one: a quick test before the slow one."""
_NAME = re.compile(r"(?<![\w.$'\"/])[A-Za-z]\w*", re.ASCII)


def warn_unmarked(value: Node, source: Source, known: Container[str], *, prose: bool) -> None:
    """Warn of the known names in a value's texts; of bare ones only outside of prose.

    A bare name in quotes is text.
    """
    waiting = [value]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Scalar):
            marked = not _SIGNS.isdisjoint(node.text) and _FORMS.search(node.text)
            if marked and not names_file(node.text):
                _in_other_words(node, source, known)
            if not prose and (right := marked_here(node, source, known)) is not None:
                source.report(
                    "BT315", span_of(node), f"{node.text!r} is text here: no variable is read",
                    hint=f"{right}, or put it in quotes to mean the text",
                )  # fmt: skip
        elif isinstance(node, Mapping):
            waiting.extend([inner for _, inner in reversed(node.pairs)])
        elif isinstance(node, Listing):
            waiting.extend(reversed(node.items))


def _in_other_words(node: Scalar, source: Source, known: Container[str]) -> None:
    for match in _FORMS.finditer(node.text):
        path = next(group for group in match.groups() if group)
        name = path.partition(".")[0]
        if name in known:
            source.unread.meant.add(name)
            right = f"${path}" if match[0] == node.text else f"$({path})"
            source.report(
                "BT315", inner_span(node, source, *match.span()),
                f"{match[0]!r} is text here, not the value of ${path}", hint=f"write {right}",
            )  # fmt: skip


def marked_here(node: Node, source: Source, known: Container[str]) -> str | None:
    """Say what to write for a text of nothing but names of variables and their computations."""
    if not isinstance(node, Scalar) or not node.plain or "$" in node.text:
        return None
    marked = _NAME.sub(lambda name: ("$" if name[0] in known else "") + name[0], node.text)
    if marked == node.text or not computes(marked):
        return None
    source.unread.meant.update(name for name in _NAME.findall(node.text) if name in known)
    return f"write {marked}" if names_value(marked) else f"write '= {marked}' to compute it"
