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
from typing import Any

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
    if not yaml.__with_libyaml__:
        raise ImportError(NO_LIBYAML, name="libyaml")
    try:
        composer.read(yaml.CSafeLoader(source.text).get_event)
    except yaml.YAMLError as error:
        report_syntax(source, error)
        return None
    except TooManyErrors:
        return None
    return None if composer.gave_up else composer.root


class _Open:
    """A collection whose end has not come yet."""

    __slots__ = ("anchor", "before", "height", "items", "key", "keys", "node", "pairs", "refused")

    def __init__(self, node: Mapping | Listing, anchor: str | None, before: int) -> None:
        self.node = node
        self.anchor = anchor
        self.items = node.items if isinstance(node, Listing) else None
        self.pairs = node.pairs if isinstance(node, Mapping) else []
        self.key: Scalar | None = None
        self.keys: dict[str, Scalar] = {}
        self.refused = False
        """Whether a list or a mapping stands as a key."""
        self.before = before
        """How many nodes there were before it."""
        self.height = 1
        """Collections inside each other, this one among them."""


class _Composer:
    """Puts events together. No recursion: the depth of a text is the text's author's."""

    def __init__(self, source: Source, *, unfold: bool = True) -> None:
        self.root: Node | None = None
        self.gave_up = False
        self._source = source
        self.anchored: dict[int, str] = {}
        self._unfold = unfold
        self._stack: list[_Open] = []
        self._anchors: dict[str, tuple[Node, int, int] | None] = {}
        """What names stand for, with its size and its height; None while it is open."""
        self._documents = 0
        self._size = 0

    def read(self, next_event: Callable[[], Any]) -> None:
        """Take all events, or those before the first with which it gives up."""
        takes = {
            yaml.MappingStartEvent: self._mapping,
            yaml.MappingEndEvent: self._end,
            yaml.SequenceStartEvent: self._listing,
            yaml.SequenceEndEvent: self._end,
            yaml.AliasEvent: self._alias,
            yaml.DocumentStartEvent: self._document,
            yaml.StreamStartEvent: _nothing,
            yaml.DocumentEndEvent: _nothing,
        }
        while (kind := type(event := next_event())) is not yaml.StreamEndEvent:
            if kind is yaml.ScalarEvent:
                node = Scalar()
                node.text = event.value
                node.plain = not event.style
                node.begin, node.end = event.start_mark, event.end_mark
                if event.tag is not None or event.anchor is not None:
                    self._marked(node, event)
                self._add(node, 0)
            else:
                takes[kind](event)
            if self._size > MAX_NODES and not self.gave_up:
                text = f"this is, or unfolds to, more than {MAX_NODES:,} nodes"
                self._report("BT105", event, text)
                self.gave_up = True
            if self.gave_up:
                return

    def _document(self, event: Any) -> None:
        self._documents += 1
        if self._documents == 2:
            self._report("BT106", event, "a second document begins here; one file, one tree")
            self.gave_up = True

    def _report(self, code: str, event: Any, message: str, hint: str | None = None) -> None:
        self._source.report(code, _event_span(event), message, hint=hint)

    def _marked(self, node: Scalar, event: Any) -> None:
        if event.tag is not None:
            node.plain = False
        if event.tag not in (None, "!", "tag:yaml.org,2002:str"):
            self._report("BT109", event, f"the tag {event.tag!r} has no meaning in a tree")
            self._source.settled.add(_event_span(event))
            self._source.unread.nodes.append(node)
        if event.anchor is not None:
            self._source.anchored = True
            self.anchored[id(node)] = event.anchor
            self._anchors[event.anchor] = (node, 1, 0)

    def _mapping(self, event: Any) -> None:
        node = Mapping()
        node.pairs = []
        self._begin(node, event)

    def _listing(self, event: Any) -> None:
        node = Listing()
        node.items = []
        self._begin(node, event)

    def _begin(self, node: Mapping | Listing, event: Any) -> None:
        if len(self._stack) >= MAX_DEPTH:
            self._too_deep(event)
            return
        if event.tag is not None and event.tag != "!":
            self._report("BT109", event, f"the tag {event.tag!r} has no meaning in a tree")
        node.begin, node.end = event.start_mark, event.end_mark
        node.flow = bool(event.flow_style)
        if event.anchor is not None:
            self._source.anchored = True
            self.anchored[id(node)] = event.anchor
            self._anchors[event.anchor] = None
        self._stack.append(_Open(node, event.anchor, self._size))

    def _too_deep(self, event: Any) -> None:
        self._report("BT105", event, f"nested deeper than {MAX_DEPTH} levels")
        self.gave_up = True

    def _end(self, event: Any) -> None:
        done = self._stack.pop()
        node = done.node
        if node.flow:
            node.end = event.end_mark
        elif done.items or done.pairs:
            last = done.items[-1] if done.items else done.pairs[-1][1]
            if last.end.index > node.begin.index:
                node.end = last.end
        size = self._size - done.before + 1
        if isinstance(node, Mapping) and "<<" in done.keys and self._unfold:
            self._merge(node)
        if done.refused and not done.pairs:
            self._source.settled.add(span_of(node))
        if done.anchor is not None:
            self._anchors[done.anchor] = (node, size, done.height)
        self._add(node, done.height)

    def _alias(self, event: Any) -> None:
        if event.anchor not in self._anchors:
            self._report("BT102", event, f"there is no anchor &{event.anchor} above")
            self.gave_up = True
            return
        found = self._anchors[event.anchor]
        if found is None:
            self._report("BT105", event, f"*{event.anchor} holds itself")
            self.gave_up = True
            return
        if not self._unfold:
            alias = Alias()
            alias.name = event.anchor
            alias.begin, alias.end = event.start_mark, event.end_mark
            self._add(alias, 0)
            return
        node, size, height = found
        if len(self._stack) + height > MAX_DEPTH:
            self._too_deep(event)
            return
        self._size += size - 1
        self._add(node, height)

    def _add(self, node: Node, height: int) -> None:
        self._size += 1
        if not self._stack:
            if self.root is None:
                self.root = node
            return
        frame = self._stack[-1]
        if height >= frame.height:
            frame.height = height + 1
        if frame.items is not None:
            frame.items.append(node)
        elif (key := frame.key) is None:
            frame.key = self._key(frame, node)
        else:
            frame.key = None
            if key is _REFUSED:
                self._source.unread.nodes.append(node)
            else:
                frame.pairs.append((key, node))

    def _key(self, frame: _Open, node: Node) -> Scalar:
        if type(node) is not Scalar:
            hint = _braced(node) or "a text that begins with { or [ needs quotes"
            message = "a key is a single word, not a list or a mapping"
            self._source.report("BT109", span_of(node), message, hint=hint)
            frame.refused = True
            return _REFUSED
        node.text = sys.intern(node.text)  # a tree has few keys, and says them often
        first = frame.keys.setdefault(node.text, node)
        if first is not node:
            place = Place(self._source.name, first.line, first.column)
            self._source.report(
                "BT104", span_of(node), f"the key {node.text!r} is here twice",
                hint="<<: [*a, *b]" if node.text == "<<" else None,
                related=Related(place, "first here"),
            )  # fmt: skip
            return _REFUSED
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


_REFUSED = Scalar()


def _braced(node: Node) -> str | None:
    """What to write for `{{ x }}`, where the inner braces stand as a key."""
    if not isinstance(node, Mapping) or len(node.pairs) != 1 or not node.flow:
        return None
    key, value = node.pairs[0]
    empty = isinstance(value, Scalar) and value.plain and not value.text
    named = re.fullmatch(r"[A-Za-z_][\w.]*", key.text, re.ASCII)
    return f"a variable is written ${key.text}" if empty and named else None


def _nothing(event: Any) -> None:
    """Of this event nothing is to be kept."""


def _event_span(event: Any) -> Span:
    start, end = event.start_mark, event.end_mark
    return Span(start.line + 1, start.column + 1, end.line + 1, end.column + 1)
