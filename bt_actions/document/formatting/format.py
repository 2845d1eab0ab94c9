"""A tree in canonical form: two spaces, a node's kind first, keys as in the model, comments kept.

Scalars stay as they were written, and so does what stands in { } or [ ] with comments or texts of
several lines in it. What comes out is read again and compared before it is given back, so that
formatting can never change what a tree means.
"""

from __future__ import annotations

from collections import Counter

from bt_actions.document.findings import DocumentError, Span
from bt_actions.document.formatting.layout import FormatError, Layout, forms
from bt_actions.document.language.keys import TOP_KEYS
from bt_actions.document.yaml.comments import comments_of, scalars_of
from bt_actions.document.yaml.compose import compose, compose_written
from bt_actions.document.yaml.nodes import Alias, Listing, Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source

__all__ = ["FormatError", "format_source"]


def format_source(source: Source) -> str:
    """The text of a document in canonical form.

    Raises DocumentError when it is not YAML, FormatError for what cannot be kept as it is.
    """
    if compose(source) is None or source.has_errors:
        if not source.findings:
            source.report("BT106", Span(1, 1, 1, 2), "the file is empty")
        raise DocumentError(source.findings)
    root, anchors = _written(source)
    if not isinstance(root, Mapping) or root.flow:
        raise FormatError("this is not a tree that could be formatted")
    if id(root) in anchors:
        raise FormatError(f"line {root.line}: an anchor names the whole document")
    layout = Layout(source, root, anchors)
    layout.head()
    layout.mapping(root, 0, forms(TOP_KEYS))
    text = layout.finish()
    _compare(source, root, anchors, text)
    return text


def _written(source: Source) -> tuple[Node | None, dict[int, str]]:
    again = Source(source.name, source.text)
    root, anchors = compose_written(again)
    if again.findings:  # of these forms alone: the text itself is sound
        raise FormatError(f"line {again.findings[0].line}: an alias stands for a key")
    for name, times in Counter(anchors.values()).items():
        if times > 1:
            raise FormatError(f"the anchor &{name} names {times} things")
    return root, anchors


def _compare(source: Source, root: Node, anchors: dict[int, str], text: str) -> None:
    """See that the new text says the same, with every comment of the old one."""
    again = Source(source.name, text)
    formatted, names = compose_written(again)
    if any("no anchor" in finding.message for finding in again.findings):
        raise FormatError("an alias would come before what it repeats, in the order of the keys")
    if formatted is None or again.findings or _data(formatted, names) != _data(root, anchors):
        raise FormatError("it holds a form that cannot be kept as it is")
    before = sorted(one.text for one in comments_of(source, scalars_of(root)))
    if sorted(one.text for one in comments_of(again, scalars_of(formatted))) != before:
        raise FormatError("a comment stands where it could not be kept")


def _data(node: Node, anchors: dict[int, str]) -> object:
    """What a node says, without unfolding aliases; keys in one order."""
    name = anchors.get(id(node))
    if isinstance(node, Alias):
        return ("*", node.name)
    if isinstance(node, Scalar):
        return (name, node.text, node.plain)
    if isinstance(node, Listing):
        return (name, [_data(item, anchors) for item in node.items])
    assert isinstance(node, Mapping)
    pairs = [(key.text, anchors.get(id(key)), _data(value, anchors)) for key, value in node.pairs]
    return (name, sorted(pairs, key=lambda pair: pair[0]))
