"""A tree in canonical form: two spaces, a node's kind first, keys as in the model, comments kept.

Scalars stay as they are written. So does a { } or [ ] that holds a comment, or a text of several
lines. The new text is read again and compared before it is returned: formatting never changes the
meaning of a tree.

A comment goes with the line that follows it, or stays behind the words before it. A comment that
silences a warning goes with the line that follows it, even where the item of that line moves.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Iterable, Iterator
from collections.abc import Mapping as MappingType

from bt_actions.document.findings import DocumentError, Span
from bt_actions.document.kinds import KINDS
from bt_actions.document.language.keys import ACTION_KEYS, NODE, NODES, TOP_KEYS, ConditionOrNode
from bt_actions.document.language.kinds import OWN_KINDS
from bt_actions.document.language.scalars import Shape
from bt_actions.document.language.shapes import Key, ListOf, OneOf, Record, Table
from bt_actions.document.yaml.compose import compose, compose_written
from bt_actions.document.yaml.nodes import Alias, Listing, Mapping, Node, Scalar, walk
from bt_actions.document.yaml.source import Source
from bt_actions.document.yaml.written import (
    Comment,
    block_header,
    comments_of,
    is_ignore,
    scalars_of,
)

_STEP = 2
_DASHES = re.compile(r"\s*-(\s+-)*\s*")


def format_source(source: Source) -> str:
    """Return the text of a document in canonical form.

    Raises DocumentError for a text that is not YAML, FormatError for one that would lose something.
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
    layout = _Layout(source, root, anchors)
    layout.head()
    layout.mapping(root, 0, _forms(TOP_KEYS))
    text = layout.finish()
    _compare(source, root, anchors, text)
    return text


def _written(source: Source) -> tuple[Node | None, dict[int, str]]:
    again = Source(source.name, source.text)
    root, anchors = compose_written(again)
    if again.findings:  # a form is at fault: the text is sound
        raise FormatError(f"line {again.findings[0].line}: an alias stands for a key")
    for name, times in Counter(anchors.values()).items():
        if times > 1:
            raise FormatError(f"the anchor &{name} names {times} things")
    return root, anchors


def _compare(source: Source, root: Node, anchors: dict[int, str], text: str) -> None:
    """Compare the new text with the old: the same data, with every comment."""
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
    """Return a node's data, without unfolding aliases; keys in one order."""
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


class FormatError(ValueError):
    """YAML that cannot be formatted without a loss; the text stays as it is."""


class _Layout:
    """The lines so far. Each method adds the lines of one part of the document."""

    def __init__(self, source: Source, root: Node, anchors: MappingType[int, str]) -> None:
        self._source = source
        self._anchors = anchors
        self._lines: list[str] = []
        comments = list(comments_of(source, scalars_of(root)))
        self._behind = {one.line: one for one in comments if not one.alone}
        self._alone = {one.line: one for one in comments if one.alone}
        self._ignores = {line for line, one in self._alone.items() if is_ignore(one)}
        self._ends = _trailing_comments(root, source, self._alone, anchors)
        self._used = {line for block in self._ends.values() for line, _ in block}
        self._bare = set(_bare_dashes(source, root))

    def head(self) -> None:
        """Add comments at the top of the file that have a blank line behind them."""
        lines = self._source.lines
        end = next((at for at, line in enumerate(lines) if not line.startswith("#")), len(lines))
        if not self._ignores.isdisjoint(range(end + 1)):
            return
        if 0 < end < len(lines) and not lines[end].strip():
            self._lines += [*(line.rstrip() for line in lines[:end]), ""]
            self._used.update(range(1, end + 2))

    def mapping(
        self, node: Mapping, indent: int, shapes: MappingType[str, Shape | None], lead: str = ""
    ) -> None:
        """Add a block mapping; `lead` stands before its first key (the dash of a list's item)."""
        for at, (key, value) in enumerate(_in_order(node, shapes)):
            before = " " * (indent - len(lead)) + lead if at == 0 else " " * indent
            if at or not lead:
                self._leading(key.line, indent)
            self._pair(before, key, value, indent, shapes.get(key.text))
        self._trailing(node, indent)

    def _pair(
        self, before: str, key: Scalar, value: Node, indent: int, shape: Shape | None
    ) -> None:
        head = f"{before}{self._raw(key)}:"
        if isinstance(value, Mapping) and not value.flow and value.pairs:
            self._opening(head, key.line, value)
            self.mapping(value, indent + _STEP, _shapes_of(value, shape))
        elif isinstance(value, Listing) and not value.flow and value.items:
            self._opening(head, key.line, value)
            self._items(value, indent + _STEP, _item_shape(shape))
        else:
            self._value(head, value, key.line, indent, shape)

    def _opening(self, head: str, line: int, value: Node) -> None:
        """Add the line above a block collection, with its anchor."""
        anchor = self._anchor(value)
        if anchor:
            self._between(head, line, value)
        self._put(head + anchor, line, *((value.line,) if anchor else ()))

    def _items(self, node: Listing, indent: int, shape: Shape | None, lead: str = "") -> None:
        for at, item in enumerate(node.items):
            before = lead if at == 0 else ""
            if not before:
                self._leading(self._first_ignore(item, shape), indent)
            self._item(item, indent, shape, f"{before}- ")
        self._trailing(node, indent)

    def _first_ignore(self, item: Node, shape: Shape | None) -> int:
        """Return the line of an item, or of the first ignore above it about a moving key."""
        line = at = item.line
        if not self._ignores or not isinstance(item, Mapping) or item.flow:
            return line
        if _in_order(item, _shapes_of(item, shape))[0][0].line == line:
            return line
        while at > 1 and (at - 1 in self._alone or not self._source.lines[at - 2].strip()):
            at -= 1
            line = at if at in self._ignores else line
        return line

    def _item(self, item: Node, indent: int, shape: Shape | None, lead: str) -> None:
        """Add an item of a block list; `lead` is its dash, behind those of lists around it."""
        start = " " * (indent + _STEP - len(lead)) + lead.rstrip()
        if isinstance(item, Mapping) and not item.flow and item.pairs:
            shapes = _shapes_of(item, shape)
            if id(item) in self._anchors:
                self._put(start + self._anchor(item), item.line)
                self.mapping(item, indent + _STEP, shapes)
                return
            first = _in_order(item, shapes)[0][0]
            if first.line != item.line:
                self._leading(first.line, indent + _STEP - len(lead))
            self.mapping(item, indent + _STEP, shapes, lead)
        elif isinstance(item, Listing) and not item.flow and item.items:
            if id(item) in self._anchors:
                raise FormatError(f"line {item.line}: an anchor at a list in a list")
            self._items(item, indent + _STEP, _item_shape(shape), lead)
        else:
            self._value(start, item, item.line, indent, shape)

    def _value(self, head: str, value: Node, line: int, indent: int, shape: Shape | None) -> None:
        """Add a scalar, an alias or a flow collection behind a key or a dash."""
        self._between(head, line, value)
        if isinstance(value, Alias):
            self._put(f"{head} *{value.name}", line, value.line)
        elif isinstance(value, Scalar) and value.line == value.end_line:
            self._put(f"{head} {self._raw(value)}".rstrip(), line, value.line)
        elif isinstance(value, Scalar) and block_header(value, self._source):
            self._block(head, value, line, indent)
        elif isinstance(value, Scalar) or self._as_written(value):
            self._verbatim(head, value, line, indent)
        else:
            self._put(f"{head} {self._flow(value, shape)}", line, value.line, value.end_line)

    def _as_written(self, value: Node) -> bool:
        """Return whether a flow collection keeps its lines, for a comment or a longer text."""
        if any(at in self._behind or at in self._alone for at in range(value.line, value.end_line)):
            return True
        return any(scalar.line != scalar.end_line for scalar in scalars_of(value))

    def _flow(self, node: Node, shape: Shape | None) -> str:
        if isinstance(node, Scalar):
            return self._raw(node)
        if isinstance(node, Alias):
            return f"*{node.name} "  # a ':' or ',' behind the name would belong to it
        anchor = self._anchor(node).lstrip()
        anchor = f"{anchor} " if anchor else ""
        if isinstance(node, Listing):
            said = ", ".join(self._flow(item, _item_shape(shape)).rstrip() for item in node.items)
            return f"{anchor}[{said}]"
        assert isinstance(node, Mapping)
        parts = []
        shapes = _shapes_of(node, shape)
        for key, value in _in_order(node, shapes):
            said = self._flow(value, shapes.get(key.text))
            parts.append(f"{self._raw(key)}: {said}")
        return f"{anchor}{{{', '.join(parts)}}}"

    def _block(self, head: str, value: Scalar, line: int, indent: int) -> None:
        """Add a text behind | or >: its lines keep their own indentation beyond the margin."""
        header = block_header(value, self._source)
        if any(char.isdigit() for char in header):
            raise FormatError(f"line {value.line}: a block text that gives its own indentation")
        first = self._source.line(value.line) or ""
        end = first.index(header, value.column - 1) + len(header)
        self._put(f"{head} {first[value.column - 1 : end]}", line, value.line)
        last = value.end_line if value.end_column > 1 else value.end_line - 1
        body = [self._source.line(at) or "" for at in range(value.line + 1, last + 1)]
        if "+" in header:  # blank lines at the end count
            self._used.update(range(value.line + 1, last + 1))
        else:
            while body and not body[-1].strip():
                body.pop()
        told = [_indent(text) for text in body if text.strip()]
        margin = min(told) if told else max(map(len, body), default=0)
        for text in body:
            kept = text[margin:]
            self._lines.append(" " * (indent + _STEP) + kept if kept else "")

    def _verbatim(self, head: str, value: Node, line: int, indent: int) -> None:
        """Add a value over several lines as it is written; only the indentation changes."""
        lines = [self._source.line(at) or "" for at in range(value.line, value.end_line + 1)]
        lines[-1] = lines[-1][: value.end_column - 1]
        if isinstance(value, Scalar):
            lines[1:] = [text.lstrip() for text in lines[1:]]
        margin = min((_indent(text) for text in lines[1:] if text.strip()), default=0)
        first, *rest = lines
        inside = range(value.line, value.end_line)
        self._used.update(at for at in inside if at != line or value.line == line)
        if value.line > line:
            self._put_above(head, line)
        self._lines.append(_trimmed(f"{head} {first[value.column - 1 :]}"))
        for text in rest[:-1]:
            self._lines.append(_trimmed(" " * (indent + _STEP) + text[margin:]))
        self._put(" " * (indent + _STEP) + rest[-1][margin:], value.end_line)

    def _raw(self, scalar: Scalar) -> str:
        """Return a scalar of one line as it is written, with its anchor."""
        line = self._source.line(scalar.line) or ""
        return line[scalar.column - 1 : scalar.end_column - 1]

    def _anchor(self, node: Node) -> str:
        name = self._anchors.get(id(node))
        return "" if name is None else f" &{name}"

    def _leading(self, line: int, indent: int) -> None:
        """Add the comments and the blank line that stand directly before a line."""
        block: list[str] = []
        at = line - 1
        while at > 0 and at not in self._used:
            if at in self._alone or (at in self._bare and at in self._behind):
                self._used.add(at)
                comment = self._alone.get(at) or self._behind[at]
                block.append(" " * indent + comment.text)
            elif at in self._bare:
                pass  # the dash of what is on `line`
            elif (self._source.line(at) or "").strip():
                break
            else:
                self._used.add(at)
                if not block or block[-1]:
                    block.append("")
            at -= 1
        block.reverse()
        if block and not block[0] and not (self._lines and self._lines[-1]):
            block.pop(0)
        self._lines += block

    def _trailing(self, node: Node, indent: int) -> None:
        """Add the comments at the end of a block."""
        for _, text in self._ends.get(id(node), ()):
            if text or self._lines[-1]:
                self._lines.append(" " * indent + text if text else "")

    def _put(self, text: str, *lines: int) -> None:
        """Add a line with the last comment behind its parts; other comments go above the line."""
        comments = [one for one in map(self._take, dict.fromkeys(lines)) if one is not None]
        indent = " " * _indent(text)
        self._lines += [indent + comment.text for comment in comments[:-1]]
        for comment in comments[-1:]:
            column = comment.column - 1
            text = f"{text.ljust(column)}{'' if len(text) < column else '  '}{comment.text}"
        self._lines.append(text)

    def _between(self, head: str, line: int, value: Node) -> None:
        """Add the comments between a key and a value that begins further down: above the key."""
        if any(at in self._alone for at in range(line + 1, value.line)):
            self._put_above(head, line)
        if value.line > line:
            self._leading(value.line, _indent(head))

    def _put_above(self, head: str, line: int) -> None:
        """Add, above a key, the comment behind it, where the value begins on a later line."""
        comment = self._take(line)
        if comment is not None:
            self._lines.append(" " * _indent(head) + comment.text)

    def _take(self, line: int) -> Comment | None:
        """Take the comment of a line, once."""
        if line in self._used or line not in self._behind:
            return None
        self._used.add(line)
        return self._behind[line]

    def finish(self) -> str:
        """Return the text, with the last comments at its end. Raises FormatError for others."""
        last = max((at for at, line in enumerate(self._source.lines, 1)
                    if line.strip() and at not in self._alone), default=0)  # fmt: skip
        left = [one for one in (*self._behind.values(), *self._alone.values())
                if one.line not in self._used]  # fmt: skip
        for comment in left:
            if comment.line <= last:
                raise FormatError(f"line {comment.line}: a comment that has no place of its own")
        return "\n".join([*self._lines, *(comment.text for comment in left)]) + "\n"


def _bare_dashes(source: Source, root: Node) -> Iterator[int]:
    """Yield the lines with nothing but the dash of an item that begins further down."""
    nodes = (node for node in walk(root) if not isinstance(node, Listing) or node.flow)
    starts = {node.line for node in nodes}
    for number, line in enumerate(source.lines, 1):
        if "-" in line and number not in starts and _DASHES.fullmatch(line.split("#")[0]):
            yield number


def _indent(text: str) -> int:
    return len(text) - len(text.lstrip(" "))


def _trimmed(text: str) -> str:
    """Return a text without spaces at the end, but where a backslash makes them count."""
    trimmed = text.rstrip()
    return text if trimmed.endswith("\\") else trimmed


def _shapes_of(node: Mapping, shape: Shape | None) -> MappingType[str, Shape | None]:
    """Return the form of the value under each key of a mapping, in the order of the model.

    Keys that the model does not know stay in their order, behind the others.
    """
    names = [key.text for key, _ in node.pairs]
    if shape is NODE or isinstance(shape, ConditionOrNode):
        return _node_shapes(names)
    if isinstance(shape, OneOf):
        shape = shape.record
    if isinstance(shape, Record):
        return _forms(shape.keys)
    if isinstance(shape, Table):
        return dict.fromkeys(names, shape.item)
    return dict.fromkeys(names)


def _node_shapes(names: list[str]) -> MappingType[str, Shape | None]:
    """Return the keys of a node with their forms: its kind or action first, its children last."""
    kinds = [name for name in names if name in KINDS]
    if "child" not in names:  # settings of an action, then
        kinds = [name for name in kinds if name not in ACTION_KEYS]
    held = {name for kind in kinds for name in KINDS[kind].holds if name != kind}
    kinds = [name for name in kinds if name not in held]
    own = {**OWN_KINDS["one"].keys, **OWN_KINDS["many"].keys}
    foreign = [name for name in names if name not in ACTION_KEYS and name not in own]
    if len(kinds) == 1:
        kind = KINDS[kinds[0]]
        rest = _forms(kind.keys)
        ordered: dict[str, Shape | None] = {kind.name: kind.value, "name": rest.pop("name", None)}
        last = {name: rest.pop(name) for name in kind.holds if name in rest}
        return ordered | rest | last
    if len(foreign) == 1:
        forms = {**_forms(ACTION_KEYS), **_forms(own)}
        last = {name: forms.pop(name) for name in ("child", "children")}
        return {foreign[0]: None, **forms, **last}
    return dict.fromkeys(names)


def _forms(keys: MappingType[str, Key]) -> dict[str, Shape | None]:
    """Return the form of each key, in their order."""
    return {name: key.shape for name, key in keys.items()}


def _item_shape(shape: Shape | None) -> Shape | None:
    """Return the form of a list's items."""
    if shape is NODES:
        return NODE
    return shape.item if isinstance(shape, ListOf) else None


def _in_order(node: Mapping, order: Iterable[str]) -> list[tuple[Scalar, Node]]:
    """Return the pairs of a mapping; pairs whose keys `order` lacks stay behind the others."""
    rank = {name: at for at, name in enumerate(order)}
    return sorted(node.pairs, key=lambda pair: rank.get(pair[0].text, len(rank)))


def _trailing_comments(
    root: Node, source: Source, alone: MappingType[int, Comment], anchored: Container[int]
) -> dict[int, list[tuple[int, str]]]:
    """Return the comments and blank lines at the end of blocks, by the block's `id`.

    A comment belongs to a block with the same indentation. A comment that silences a warning
    belongs to the line that follows it, at any indentation.
    """
    found: dict[int, list[tuple[int, str]]] = {}
    taken: set[int] = set()
    for node, column in reversed(list(_blocks(root, anchored))):  # the inner before the outer
        lines = [one for one in _lines_of(node, column, source, alone) if one[0] not in taken]
        if lines:
            found[id(node)] = lines
            taken.update(line for line, _ in lines)
    return found


def _blocks(root: Node, anchored: Container[int]) -> Iterator[tuple[Mapping | Listing, int]]:
    """Yield the block collections below the root, outer ones first, with their columns."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, Mapping) and not node.flow and node.pairs:
            if node is not root:
                yield node, node.pairs[0][0].column
            stack.extend(value for _, value in node.pairs)
        elif isinstance(node, Listing) and not node.flow and node.items:
            if id(node) not in anchored:  # an anchor has a column of its own
                yield node, node.column
            stack.extend(node.items)


def _lines_of(
    node: Mapping | Listing, column: int, source: Source, alone: MappingType[int, Comment]
) -> list[tuple[int, str]]:
    lines = source.lines
    at = first = node.end_line + (node.end_column > 1 or node.end_line == node.line)
    while at <= len(lines) and (at in alone or not lines[at - 1].strip()):
        at += 1
    after = lines[at - 1] if at <= len(lines) else ""
    least = max(column, len(after) - len(after.lstrip(" ")) + 2 if after else 2)
    found: list[tuple[int, str]] = []
    own = 0
    for line in range(first, at):
        if line in alone and (alone[line].column < least or is_ignore(alone[line])):
            break
        found.append((line, alone[line].text if line in alone else ""))
        own = len(found) if line in alone else own
    return found[:own]
