"""How large a value in a tree's variables may be.

A tree can double a value each time round (`set: {x: [$x, $x]}`). In memory both halves are one, and
so nothing is noticed before the value is compared or made a text, which then takes for ever.
Messages and arrays are not looked into: they are as large as ROS has made them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain

from bt_actions.utilities.plain_data import numbers_only

MAX_ITEMS = 1_000_000
"""Numbers, texts, lists and mappings in one value, each counted as often as it can be reached."""
MAX_CHARACTERS = 10_000_000
"""Of all texts in one value."""
MAX_LEVELS = 100
"""Lists and mappings inside each other."""
_END = object()


def refuse_large(value: object, *, items: int = MAX_ITEMS, characters: int = MAX_CHARACTERS) -> int:
    """Return how many items a value has.

    Raises ValueError for one that is larger, or nested deeper than `MAX_LEVELS`. Takes no more time
    than a value of the largest size.
    """
    left = items
    stack: list[Iterator[object]] = [iter((value,))]
    while stack:
        item = next(stack[-1], _END)
        if item is _END:
            stack.pop()
            continue
        left -= 1
        if isinstance(item, str):
            characters -= len(item)
        elif isinstance(item, list | tuple):
            if len(item) <= left and numbers_only(item):
                left -= len(item)
                continue
            stack.append(iter(item))
        elif isinstance(item, Mapping):
            stack.append(chain.from_iterable(item.items()))
        if left < 0 or characters < 0:
            raise ValueError("the value is too large")
        if len(stack) > MAX_LEVELS + 1:
            raise ValueError(f"the value is nested deeper than {MAX_LEVELS} levels")
    return items - left
