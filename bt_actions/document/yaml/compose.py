"""From YAML text to nodes. Says nothing about behaviour trees.

libyaml's events are put together here rather than by PyYAML's own composer: nesting, aliases and
memory stay bounded, both ends of every node are kept, and duplicate keys are seen. PyYAML's parser
in Python is not used in its place: it is ten times as slow, and says other things about the same
mistakes.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import Any, NoReturn

import yaml

from bt_actions.document.findings import Place, Related, Span
from bt_actions.document.yaml.nodes import Alias, Listing, Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source, TooManyErrors
from bt_actions.document.yaml.syntax import report_syntax

__all__ = ["MAX_DEPTH", "MAX_NODES", "compose", "compose_written"]

MAX_DEPTH = 200
"""Levels of YAML nesting, aliases unfolded; a level of the tree takes two."""
MAX_NODES = 2_000_000
"""Nodes of a text, its aliases unfolded; a tree of 100,000 nodes has about a third of it."""
_TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"
NO_LIBYAML = (
    "trees are read with libyaml, and PyYAML is installed without it here; its wheels hold it: "
    "pip install --force-reinstall --only-binary :all: PyYAML"
)


def compose(source: Source) -> Node | None:
    """The document in a source, or None when it has none or cannot be read.

    What is wrong is reported to the source; after a syntax error, or too many of others, nothing
    can be read on. Raises ImportError, with the name libyaml, where that is missing.
    """
    source.root = _composed(_Composer(source), source)
    return source.root


def compose_written(source: Source) -> tuple[Node | None, dict[int, str]]:
    """As `compose`, but nothing is unfolded or merged: aliases stand as `Alias`.

    Also gives the anchors, by the `id` of what they name.
    """
    composer = _Composer(source, unfold=False)
    return _composed(composer, source), composer.anchored


def _composed(composer: _Composer, source: Source) -> Node | None:
    try:
        return composer.read()
    except yaml.YAMLError as error:
        report_syntax(source, error)
    except (TooManyErrors, _GaveUp):
        pass
    return None


class _GaveUp(Exception):
    """What was reported lets nothing be read on."""


class _Composer:
    """Puts events together, by recursion: no deeper than `MAX_DEPTH`."""

    def __init__(self, source: Source, *, unfold: bool = True) -> None:
        if not yaml.__with_libyaml__:
            raise ImportError(NO_LIBYAML, name="libyaml")
        self._source = source
        self._next: Callable[[], Any] = yaml.CSafeLoader(source.text).get_event
        self.anchored: dict[int, str] = {}
        self._unfold = unfold
        self._anchors: dict[str, tuple[Node, int, int] | None] = {}
        """What names stand for, with its size and its height; None while it is open."""
        self._size = 0
        self._level = 0
        """How many collections are open."""
        self._deepest = 0
        """How many have been since the last of `_named` began."""
        self._named: list[tuple[int, int]] = []
        """Of each open collection that has an anchor, the size and the deepest before it."""
        self._takes: dict[type, Callable[[Any], Node]] = {
            yaml.ScalarEvent: self._scalar,
            yaml.MappingStartEvent: self._mapping,
            yaml.SequenceStartEvent: self._listing,
            yaml.AliasEvent: self._alias,
        }

    def read(self) -> Node | None:
        """The document, after all events were taken. Raises _GaveUp."""
        root = None
        while type(event := self._next()) is not yaml.StreamEndEvent:
            if type(event) is yaml.DocumentStartEvent:
                if root is not None:
                    self._give_up(
                        "BT106", event, "a second document begins here; one file, one tree"
                    )
                event = self._next()
                root = self._takes[type(event)](event)
        return root

    def _report(self, code: str, event: Any, message: str) -> None:
        self._source.report(code, _event_span(event), message)

    def _give_up(self, code: str, event: Any, message: str) -> NoReturn:
        self._report(code, event, message)
        raise _GaveUp

    def _too_large(self, event: Any) -> NoReturn:
        text = f"this is, or unfolds to, more than {MAX_NODES:,} nodes"
        self._give_up("BT105", event, text)

    def _scalar(self, event: Any) -> Scalar:
        node = Scalar()
        node.text = event.value
        node.plain = not event.style
        node.begin, node.end = event.start_mark, event.end_mark
        if event.tag is not None:
            node.plain = False
            if event.tag not in ("!", "tag:yaml.org,2002:str"):
                self._report("BT109", event, f"the tag {event.tag!r} has no meaning in a tree")
                self._source.settled.add(_event_span(event))
                self._source.unread.nodes.append(node)
        if event.anchor is not None:
            self._source.anchored = True
            self.anchored[id(node)] = event.anchor
            self._anchors[event.anchor] = (node, 1, 0)
        self._size += 1
        if self._size > MAX_NODES:
            self._too_large(event)
        return node

    def _listing(self, event: Any) -> Listing:
        node = Listing()
        node.items = items = []
        anchor = event.anchor
        self._begin(node, event)
        next_event, takes = self._next, self._takes
        while (kind := type(event := next_event())) is not yaml.SequenceEndEvent:
            items.append(takes[kind](event))
        self._end(node, event, items[-1] if items else None)
        if anchor is not None:
            self._close(anchor, node)
        return node

    def _mapping(self, event: Any) -> Mapping:
        node = Mapping()
        node.pairs = pairs = []
        anchor = event.anchor
        self._begin(node, event)
        keys: dict[str, Scalar] = {}
        refused = False
        next_event, takes = self._next, self._takes
        while (kind := type(event := next_event())) is not yaml.MappingEndEvent:
            key = takes[kind](event)
            if type(key) is not Scalar:
                hint = _braced(key) or "a text that begins with { or [ needs quotes"
                message = "a key is a single word, not a list or a mapping"
                self._source.report("BT109", span_of(key), message, hint=hint)
                refused, taken = True, False
            else:
                key.text = sys.intern(key.text)  # a tree has few keys, and says them often
                taken = keys.setdefault(key.text, key) is key
                if not taken:
                    self._report_twice(key, keys[key.text])
            event = next_event()
            value = takes[type(event)](event)
            if taken:
                pairs.append((key, value))
            else:
                self._source.unread.nodes.append(value)
        self._end(node, event, pairs[-1][1] if pairs else None)
        if "<<" in keys and self._unfold:
            self._merge(node)
        if refused and not pairs:
            self._source.settled.add(span_of(node))
        if anchor is not None:
            self._close(anchor, node)
        return node

    def _report_twice(self, key: Scalar, first: Scalar) -> None:
        place = Place(self._source.name, first.line, first.column)
        self._source.report(
            "BT104", span_of(key), f"the key {key.text!r} is here twice",
            hint="<<: [*a, *b]" if key.text == "<<" else None,
            related=Related(place, "first here"),
        )  # fmt: skip

    def _begin(self, node: Mapping | Listing, event: Any) -> None:
        if self._level >= MAX_DEPTH:
            self._give_up("BT105", event, _TOO_DEEP)
        if event.tag is not None and event.tag != "!":
            self._report("BT109", event, f"the tag {event.tag!r} has no meaning in a tree")
        node.begin, node.end = event.start_mark, event.end_mark
        node.flow = bool(event.flow_style)
        if event.anchor is not None:
            self._source.anchored = True
            self.anchored[id(node)] = event.anchor
            self._anchors[event.anchor] = None
            self._named.append((self._size, self._deepest))
            self._deepest = self._level
        self._level += 1
        if self._level > self._deepest:
            self._deepest = self._level

    def _end(self, node: Mapping | Listing, event: Any, last: Node | None) -> None:
        self._level -= 1
        if node.flow:
            node.end = event.end_mark
        elif last is not None and last.end.index > node.begin.index:
            node.end = last.end
        self._size += 1
        if self._size > MAX_NODES:
            self._too_large(event)

    def _close(self, anchor: str, node: Node) -> None:
        before, deepest = self._named.pop()
        self._anchors[anchor] = (node, self._size - before, self._deepest - self._level)
        self._deepest = max(deepest, self._deepest)

    def _alias(self, event: Any) -> Node:
        if event.anchor not in self._anchors:
            self._give_up("BT102", event, f"there is no anchor &{event.anchor} above")
        found = self._anchors[event.anchor]
        if found is None:
            self._give_up("BT105", event, f"*{event.anchor} holds itself")
        node, size, height = found
        if not self._unfold:
            node, size, height = Alias(), 1, 0
            node.name = event.anchor
            node.begin, node.end = event.start_mark, event.end_mark
        if self._level + height > MAX_DEPTH:
            self._give_up("BT105", event, _TOO_DEEP)
        self._deepest = max(self._deepest, self._level + height)
        self._size += size
        if self._size > MAX_NODES:
            self._too_large(event)
        return node

    def _merge(self, node: Mapping) -> None:
        own = {key.text for key, _ in node.pairs}
        pairs = []
        for key, value in node.pairs:
            if key.text != "<<" or not key.plain:
                pairs.append((key, value))
                continue
            for merged in value.items if isinstance(value, Listing) else [value]:
                if not isinstance(merged, Mapping):
                    message = "'<<' merges a mapping, or a list of mappings"
                    self._source.report("BT109", span_of(merged), message)
                    self._source.unread.nodes.append(merged)
                    continue
                for inner_key, inner_value in merged.pairs:
                    if inner_key.text not in own:
                        own.add(inner_key.text)
                        pairs.append((inner_key, inner_value))
                        self._size += 1
        node.pairs = pairs


def _braced(node: Node) -> str | None:
    """What to write for `{{ x }}`, where the inner braces stand as a key."""
    if not isinstance(node, Mapping) or len(node.pairs) != 1 or not node.flow:
        return None
    key, value = node.pairs[0]
    empty = isinstance(value, Scalar) and value.plain and not value.text
    named = re.fullmatch(r"[A-Za-z_][\w.]*", key.text, re.ASCII)
    return f"a variable is written ${key.text}" if empty and named else None


def _event_span(event: Any) -> Span:
    start, end = event.start_mark, event.end_mark
    return Span(start.line + 1, start.column + 1, end.line + 1, end.column + 1)
