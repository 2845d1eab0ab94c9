"""A tree in canonical form: two spaces, a node's kind first, keys as in the model, comments kept.

Scalars stay as they were written. What comes out is read again and compared before it is given
back, so that formatting can never change what a tree means.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as MappingType

from bt_actions.document.comments import comments_of, scalars_of
from bt_actions.document.findings import DocumentError, Span
from bt_actions.document.model import ACTION_KEYS, KINDS, NODE, NODES, TOP_KEYS
from bt_actions.document.nodes import Listing, Mapping, Node, Scalar, compose
from bt_actions.document.shape import Shape
from bt_actions.document.shapes import Key, ListOf, OneOf, Record, Table
from bt_actions.document.source import Source

__all__ = ["FormatError", "format_source"]

_STEP = 2


class FormatError(ValueError):
    """The text is YAML that this cannot format without a loss; it was left alone."""


def format_source(source: Source) -> str:
    """The text of a document in canonical form.

    Raises DocumentError when it is not YAML, FormatError when it holds anchors, tags or comments
    in places that have no counterpart.
    """
    root = compose(source)
    if root is None or source.has_errors:
        if not source.findings:
            source.report("BT106", Span(1, 1, 1, 2), "the file is empty")
        raise DocumentError(source.findings)
    if not isinstance(root, Mapping) or root.flow:
        raise FormatError("this is not a tree that could be formatted")
    if source.anchored:
        raise FormatError("the text holds anchors")
    layout = _Layout(source, root)
    layout.head()
    layout.mapping(root, 0, _forms(TOP_KEYS))
    text = layout.finish()
    _compare(source, root, text)
    return text


def _shapes_of(node: Mapping, shape: Shape | None) -> MappingType[str, Shape | None]:
    """The form of what stands under each key of a mapping, in the order that the model has.

    Keys that it does not know stay where they are, behind the others.
    """
    names = [key.text for key, _ in node.pairs]
    if shape is NODE:
        return _node_shapes(names)
    if isinstance(shape, OneOf):
        shape = shape.record
    if isinstance(shape, Record):
        return _forms(shape.keys)
    if isinstance(shape, Table):
        return dict.fromkeys(names, shape.item)
    return dict.fromkeys(names)


def _node_shapes(names: list[str]) -> MappingType[str, Shape | None]:
    """The keys of a node: its kind or its action first, what it holds last."""
    kinds = [name for name in names if name in KINDS]
    if "child" not in names:  # settings of an action, then
        kinds = [name for name in kinds if name not in ("timeout", "retry")]
    foreign = [name for name in names if name not in ACTION_KEYS]
    if len(kinds) == 1:
        kind = KINDS[kinds[0]]
        forms = _forms(kind.keys)
        ordered: dict[str, Shape | None] = {kind.name: kind.value, "name": forms.pop("name", None)}
        last = {name: forms.pop(name) for name in ("child", "children") if name in forms}
        return ordered | forms | last
    if len(foreign) == 1:
        return {foreign[0]: None, **_forms(ACTION_KEYS)}
    return dict.fromkeys(names)


def _forms(keys: MappingType[str, Key]) -> dict[str, Shape | None]:
    return {name: key.shape for name, key in keys.items()}


def _item_shape(shape: Shape | None) -> Shape | None:
    """The form of a list's items."""
    if shape is NODES:
        return NODE
    return shape.item if isinstance(shape, ListOf) else None


def _sorted(node: Mapping, order: Iterable[str]) -> list[tuple[Scalar, Node]]:
    rank = {name: at for at, name in enumerate(order)}
    return sorted(node.pairs, key=lambda pair: rank.get(pair[0].text, len(rank)))


class _Layout:
    """Writes lines; comments go with what follows them, or stand behind what they stood behind."""

    def __init__(self, source: Source, root: Node) -> None:
        self._source = source
        self._lines: list[str] = []
        comments = list(comments_of(source, scalars_of(root)))
        self._behind = {one.line: one for one in comments if not one.alone}
        self._alone = {one.line: one for one in comments if one.alone}
        self._used: set[int] = set()

    def head(self) -> None:
        """Comments at the top of the file, with a blank line behind them, stay at the top."""
        lines = self._source.lines
        end = next((at for at, line in enumerate(lines) if not line.startswith("#")), len(lines))
        if 0 < end < len(lines) and not lines[end].strip():
            self._lines += [*(line.rstrip() for line in lines[:end]), ""]
            self._used.update(range(1, end + 2))

    def mapping(
        self, node: Mapping, indent: int, shapes: MappingType[str, Shape | None], lead: str = ""
    ) -> None:
        """A block mapping; `lead` stands before its first key (the dash of a list's item)."""
        for at, (key, value) in enumerate(_sorted(node, shapes)):
            before = " " * (indent - len(lead)) + lead if at == 0 else " " * indent
            if at or not lead:
                self._leading(key.line, indent)
            self._pair(before, key, value, indent, shapes.get(key.text))

    def _pair(
        self, before: str, key: Scalar, value: Node, indent: int, shape: Shape | None
    ) -> None:
        head = f"{before}{self._raw(key)}:"
        if isinstance(value, Mapping) and not value.flow and value.pairs:
            self._put(head, key.line)
            self.mapping(value, indent + _STEP, _shapes_of(value, shape))
        elif isinstance(value, Listing) and not value.flow and value.items:
            self._put(head, key.line)
            self._items(value, indent + _STEP, _item_shape(shape))
        else:
            self._value(head, value, key.line, indent, shape)

    def _items(self, node: Listing, indent: int, shape: Shape | None) -> None:
        for item in node.items:
            self._leading(item.line, indent)
            dash = " " * indent + "- "
            if isinstance(item, Mapping) and not item.flow and item.pairs:
                shapes = _shapes_of(item, shape)
                first = _sorted(item, shapes)[0][0]
                if first.line != item.line:
                    self._leading(first.line, indent)
                self.mapping(item, indent + _STEP, shapes, "- ")
            elif isinstance(item, Listing) and not item.flow and item.items:
                raise FormatError(f"line {item.line}: a list in a list")
            else:
                self._value(dash.rstrip(), item, item.line, indent, shape)

    def _value(self, head: str, value: Node, line: int, indent: int, shape: Shape | None) -> None:
        """A scalar or a flow collection behind a key or a dash."""
        if isinstance(value, Scalar) and not value.text and value.plain:
            self._put(head, line)
        elif isinstance(value, Scalar) and value.line != value.end_line:
            self._tall(head, value, indent)
        elif isinstance(value, Scalar):
            self._put(f"{head} {self._raw(value)}", line, value.line)
        else:
            lines = range(value.line, value.end_line + 1)
            if len(lines) > 1 and any(at in self._behind or at in self._alone for at in lines[:-1]):
                raise FormatError(f"line {value.line}: a comment inside {{ }} or [ ]")
            text = f"{head} {self._flow(value, shape)}"
            self._put(text, line, value.end_line)

    def _flow(self, node: Node, shape: Shape | None) -> str:
        if isinstance(node, Scalar):
            if node.line != node.end_line:
                raise FormatError(f"line {node.line}: a text of several lines inside {{ }} or [ ]")
            return self._raw(node)
        if isinstance(node, Listing):
            return (
                "[" + ", ".join(self._flow(item, _item_shape(shape)) for item in node.items) + "]"
            )
        assert isinstance(node, Mapping)
        parts = []
        shapes = _shapes_of(node, shape)
        for key, value in _sorted(node, shapes):
            said = self._flow(value, shapes.get(key.text))
            parts.append(f"{self._raw(key)}: {said}")
        return "{" + ", ".join(parts) + "}"

    def _tall(self, head: str, value: Scalar, indent: int) -> None:
        """A text of several lines: a block keeps its lines, others are put on one in quotes."""
        first = self._source.line(value.line) or ""
        header = first[value.column - 1 :].split(" #")[0].rstrip()
        if header[:1] not in ("|", ">") or any(char.isdigit() for char in header):
            raise FormatError(f"line {value.line}: a text of several lines that is no block")
        self._put(f"{head} {header}", value.line)
        last = value.end_line if value.end_column > 1 else value.end_line - 1
        body = [self._source.line(at) or "" for at in range(value.line + 1, last + 1)]
        while body and not body[-1].strip():
            body.pop()
        margin = min((len(text) - len(text.lstrip()) for text in body if text.strip()), default=0)
        for text in body:
            self._lines.append((" " * (indent + _STEP) + text[margin:]).rstrip())

    def _raw(self, scalar: Scalar) -> str:
        """A scalar of one line as it was written."""
        line = self._source.line(scalar.line) or ""
        return line[scalar.column - 1 : scalar.end_column - 1]

    def _leading(self, line: int, indent: int) -> None:
        """The comments and the blank line that stand directly before a line."""
        block: list[str] = []
        at = line - 1
        while at > 0 and at not in self._used:
            if at in self._alone:
                self._used.add(at)
                block.append(" " * indent + self._alone[at].text)
            elif (self._source.line(at) or "").strip():
                break
            elif not block or block[-1]:
                block.append("")
            at -= 1
        block.reverse()
        if block and not block[0] and not (self._lines and self._lines[-1]):
            block.pop(0)
        self._lines += block

    def _put(self, text: str, *lines: int) -> None:
        """A line, with the comments that stood behind what is on it."""
        for line in lines:
            if line in self._behind and line not in self._used:
                self._used.add(line)
                comment = self._behind[line]
                column = comment.column - 1
                text = f"{text.ljust(column)}{'' if len(text) < column else '  '}{comment.text}"
        self._lines.append(text)

    def finish(self) -> str:
        """The text; comments at the end of the file stay there."""
        rest = [one.text for at, one in self._alone.items() if at not in self._used]
        return "\n".join([*self._lines, *rest]) + "\n"


def _compare(source: Source, root: Node, text: str) -> None:
    """See that the new text says the same, with every comment of the old one."""
    again = Source(source.name, text)
    formatted = compose(again)
    if formatted is None or again.findings or _data(formatted) != _data(root):
        raise FormatError("the text holds anchors, tags or forms that cannot be kept")
    before = sorted(one.text for one in comments_of(source, scalars_of(root)))
    if sorted(one.text for one in comments_of(again, scalars_of(formatted))) != before:
        raise FormatError("a comment stands where it could not be kept")


def _data(node: Node) -> object:
    if isinstance(node, Scalar):
        return (node.text, node.plain)
    if isinstance(node, Listing):
        return [_data(item) for item in node.items]
    assert isinstance(node, Mapping)
    return {key.text: _data(value) for key, value in node.pairs}
