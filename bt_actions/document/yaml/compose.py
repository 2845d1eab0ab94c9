"""From YAML text to nodes. Knows nothing of behaviour trees.

A composer of our own puts libyaml's events together, in place of PyYAML's: nesting, aliases and
memory stay bounded, both ends of every node are kept, and duplicate keys are seen. PyYAML's parser
in Python does not serve instead: it is ten times as slow, and words the same mistakes differently.

libyaml ends a line at U+0085, U+2028 and U+2029, as YAML 1.1 had it, and refuses a character that
JSON writes as two halves of UTF-16 (``"\\ud83d\\ude00"``). A stand-in takes the place of each such
character: a code point that Unicode sets aside, and that no text holds. Every place stays the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import chain, repeat, starmap
from sys import intern
from typing import Any, NoReturn

import yaml
from yaml import AliasEvent, MappingEndEvent, MappingStartEvent, ScalarEvent, SequenceEndEvent
from yaml import SequenceStartEvent as ListingStartEvent

from bt_actions.document.findings import Place, Related, Span
from bt_actions.document.yaml.nodes import Alias, Listing, Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source, TooManyErrors
from bt_actions.document.yaml.syntax import report_syntax

MAX_DEPTH = 200
"""Levels of YAML nesting, aliases unfolded; a level of the tree takes two."""
MAX_NODES = 2_000_000
"""Nodes of a text, its aliases unfolded; a list or a mapping counts twice, as it begins and ends.
A tree of 100,000 nodes has about half of this.
"""
_TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"
_TOO_LARGE = f"this is, or unfolds to, more than {MAX_NODES:,} nodes"
_SEPARATORS = {"\x85": "\ufdd0", "\u2028": "\ufdd1", "\u2029": "\ufdd2"}
_BACKSLASH = "\ufdd3"
_RESTORED = str.maketrans({inside: char for char, inside in _SEPARATORS.items()})
_HALVES = r"u(d[89ab][0-9a-f]{2})%su(d[c-f][0-9a-f]{2})"
_PAIR = re.compile(r"(?<!\\)((?:\\\\)*)\\" + _HALVES % r"\\", re.IGNORECASE)
_PUT_AWAY = re.compile(_BACKSLASH + _HALVES % _BACKSLASH, re.IGNORECASE)
NO_LIBYAML = (
    "trees are read with libyaml, and PyYAML is installed without it here; its wheels hold it: "
    "pip install --force-reinstall --only-binary :all: PyYAML"
)


def compose(source: Source) -> Node | None:
    """Return the document in a source, or None where there is none, or none that can be read.

    Mistakes are reported to the source; a syntax error, or too many other errors, ends the
    reading. Raises ImportError, with the name libyaml, where that is missing.
    """
    source.root = _composed(_Composer(source), source)
    return source.root


def compose_written(source: Source) -> tuple[Node | None, dict[int, str]]:
    """Return the document with aliases left as `Alias` and nothing merged, and the anchors.

    An anchor stands under the `id` of the node that it names.
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
    """An end of the reading, after a report."""


class _Composer:
    """A composer of events, by recursion no deeper than `MAX_DEPTH`."""

    def __init__(self, source: Source, *, unfold: bool = True) -> None:
        if not yaml.__with_libyaml__:
            raise ImportError(NO_LIBYAML, name="libyaml")
        text = _replaced(source.text)
        parser = yaml.CSafeLoader(text)
        self._source = source
        self._restores = text is not source.text
        self._events = chain(
            starmap(parser.get_event, repeat((), MAX_NODES)), self._beyond(parser.get_event)
        )
        self._unfold = unfold
        self.anchored: dict[int, str] = {}
        self._anchors: dict[str, Node | None] = {}
        """The node of each anchor; None while that node is open."""
        self._measured: dict[int, tuple[int, int]] = {}
        self._unfolded = 0
        """The size of all nodes that aliases stand for."""
        self._level = 0
        """The number of open collections."""

    def read(self) -> Node | None:
        """Take all events, and return the document. Raises _GaveUp."""
        root = None
        for event in self._events:
            if type(event) is yaml.StreamEndEvent:
                break
            if type(event) is yaml.DocumentStartEvent:
                if root is not None:
                    self._give_up(
                        "BT106", event, "a second document begins here; one file, one tree"
                    )
                event = next(self._events)
                root = _TAKES[type(event)](self, event)
        return root

    def _report(self, code: str, event: Any, message: str) -> None:
        self._source.report(code, _event_span(event), message)

    def _give_up(self, code: str, event: Any, message: str) -> NoReturn:
        self._report(code, event, message)
        raise _GaveUp

    def _beyond(self, get_event: Callable[[], Any]) -> Iterator[Any]:
        """Give up: more events follow the first `MAX_NODES`."""
        self._give_up("BT105", get_event(), _TOO_LARGE)
        yield

    def _scalar(self, event: Any) -> Scalar:
        node = Scalar()
        node.text, node.plain = event.value, not event.style
        node.begin, node.end = event.start_mark, event.end_mark
        if self._restores:
            node.text = _restored(event.value, quoted=event.style == '"')
        if event.tag is not None:
            node.plain = False
            if event.tag not in ("!", "tag:yaml.org,2002:str"):
                self._report("BT109", event, f"the tag {event.tag!r} has no meaning in a tree")
                self._source.settled.add(_event_span(event))
                self._source.unread.nodes.append(node)
        if event.anchor is not None:
            self._name(event.anchor, node)
            self._anchors[event.anchor] = node
        return node

    def _listing(self, start: Any) -> Listing:
        node = Listing()
        node.items = items = []
        self._begin(node, start)
        for event in self._events:
            if (kind := type(event)) is SequenceEndEvent:
                break
            items.append(_TAKES[kind](self, event))
        self._end(node, start, event, items[-1] if items else None)
        return node

    def _mapping(self, start: Any) -> Mapping:
        node = Mapping()
        node.pairs = pairs = []
        self._begin(node, start)
        keys: dict[str, Scalar] = {}
        refused = False
        events = self._events
        for event in events:
            if (kind := type(event)) is MappingEndEvent:
                break
            key = _TAKES[kind](self, event)
            if type(key) is Scalar and key.text not in keys:
                key.text = text = intern(key.text)  # a tree has few keys, and says them often
                keys[text] = key
                event = next(events)
                pairs.append((key, _TAKES[type(event)](self, event)))
            else:
                self._refuse(key, keys)
                event = next(events)
                self._source.unread.nodes.append(_TAKES[type(event)](self, event))
                refused = True
        self._end(node, start, event, pairs[-1][1] if pairs else None)
        if "<<" in keys and self._unfold:
            self._merge(node)
        if refused and not pairs:
            self._source.settled.add(span_of(node))
        return node

    def _refuse(self, key: Node, keys: dict[str, Scalar]) -> None:
        """Report a key that is no key, or that is there already."""
        if not isinstance(key, Scalar):
            hint = _braced(key) or "a text that begins with { or [ needs quotes"
            message = "a key is a single word, not a list or a mapping"
            self._source.report("BT109", span_of(key), message, hint=hint)
            return
        first = keys[key.text]
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
        node.begin, node.flow = event.start_mark, event.flow_style
        if event.anchor is not None:
            self._name(event.anchor, node)
            self._anchors[event.anchor] = None
        self._level += 1

    def _end(self, node: Mapping | Listing, start: Any, event: Any, last: Node | None) -> None:
        self._level -= 1
        if node.flow:
            node.end = event.end_mark
        elif last is not None and last.end.index > node.begin.index:
            node.end = last.end
        else:
            node.end = start.end_mark
        if start.anchor is not None:
            self._anchors[start.anchor] = node

    def _name(self, anchor: str, node: Node) -> None:
        self._source.anchored = True
        self.anchored[id(node)] = anchor

    def _alias(self, event: Any) -> Node:
        if event.anchor not in self._anchors:
            self._give_up("BT102", event, f"there is no anchor &{event.anchor} above")
        node = self._anchors[event.anchor]
        if node is None:
            self._give_up("BT105", event, f"*{event.anchor} holds itself")
        if not self._unfold:
            alias = Alias()
            alias.name = event.anchor
            alias.begin, alias.end = event.start_mark, event.end_mark
            return alias
        size, height = self._measure(node)
        if self._level + height > MAX_DEPTH:
            self._give_up("BT105", event, _TOO_DEEP)
        self._unfolded += size
        if self._unfolded > MAX_NODES:
            self._give_up("BT105", event, _TOO_LARGE)
        return node

    def _measure(self, node: Node) -> tuple[int, int]:
        """Return the size of a node with all that it holds, and its height in levels."""
        if isinstance(node, Mapping):
            inner = [part for pair in node.pairs for part in pair]
        elif isinstance(node, Listing):
            inner = node.items
        else:
            return 1, 0
        if id(node) not in self._measured:
            sizes, heights = zip((0, 0), *map(self._measure, inner), strict=True)
            self._measured[id(node)] = 2 + sum(sizes), 1 + max(heights)
        return self._measured[id(node)]

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
        node.pairs = pairs


_TAKES: dict[type, Callable[[_Composer, Any], Node]] = {
    ScalarEvent: _Composer._scalar,  # noqa: SLF001 - how it takes each kind of event
    MappingStartEvent: _Composer._mapping,  # noqa: SLF001
    ListingStartEvent: _Composer._listing,  # noqa: SLF001
    AliasEvent: _Composer._alias,  # noqa: SLF001
}


def _braced(node: Node) -> str | None:
    """Return what to write for `{{ x }}`, where the inner braces stand as a key."""
    if not isinstance(node, Mapping) or len(node.pairs) != 1 or not node.flow:
        return None
    key, value = node.pairs[0]
    empty = isinstance(value, Scalar) and value.plain and not value.text
    named = re.fullmatch(r"[A-Za-z_][\w.]*", key.text, re.ASCII)
    return f"a variable is written ${key.text}" if empty and named else None


def _event_span(event: Any) -> Span:
    start, end = event.start_mark, event.end_mark
    return Span(start.line + 1, start.column + 1, end.line + 1, end.column + 1)


def _replaced(text: str) -> str:
    """Return a text with the stand-ins in it; the text itself where it needs none."""
    if "\\u" in text:
        text = _PAIR.sub(rf"\1{_BACKSLASH}u\2{_BACKSLASH}u\3", text)
    if not text.isascii():
        for char, inside in _SEPARATORS.items():
            text = text.replace(char, inside)
    return text


def _restored(text: str, *, quoted: bool) -> str:
    """Return the text of a scalar without stand-ins; only in double quotes a backslash escapes."""
    if quoted:
        text = _PUT_AWAY.sub(_joined, text)
    return text.translate(_RESTORED).replace(_BACKSLASH, "\\")


def _joined(pair: re.Match[str]) -> str:
    return bytes.fromhex(pair[1] + pair[2]).decode("utf-16-be")
