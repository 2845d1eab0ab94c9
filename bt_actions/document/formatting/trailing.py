"""Comments at the end of a block: they belong to it where they are indented as what is in it.

One that silences a warning belongs to what follows it, however it is indented.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from collections.abc import Mapping as MappingType

from bt_actions.document.yaml.comments import Comment
from bt_actions.document.yaml.ignores import is_ignore
from bt_actions.document.yaml.nodes import Listing, Mapping, Node
from bt_actions.document.yaml.source import Source

Block = Mapping | Listing


def trailing_comments(
    root: Node, source: Source, alone: MappingType[int, Comment], anchored: Container[int]
) -> dict[int, list[tuple[int, str]]]:
    """The lines of such comments and blank lines, with their texts, by the `id` of the block."""
    found: dict[int, list[tuple[int, str]]] = {}
    taken: set[int] = set()
    for node, column in reversed(list(_blocks(root, anchored))):  # the inner before the outer
        lines = [one for one in _lines(node, column, source, alone) if one[0] not in taken]
        if lines:
            found[id(node)] = lines
            taken.update(line for line, _ in lines)
    return found


def _blocks(root: Node, anchored: Container[int]) -> Iterator[tuple[Block, int]]:
    """The block collections below the root, each behind what it is in, with their columns."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, Mapping) and not node.flow and node.pairs:
            if node is not root:
                yield node, node.pairs[0][0].column
            stack.extend(value for _, value in node.pairs)
        elif isinstance(node, Listing) and not node.flow and node.items:
            if id(node) not in anchored:  # else its column is its anchor's
                yield node, node.column
            stack.extend(node.items)


def _lines(
    node: Block, column: int, source: Source, alone: MappingType[int, Comment]
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
