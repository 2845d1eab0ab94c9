"""Any value as one short text for people, in time that does not grow with the value.

No ROS here: a message is known by its methods, and a cut value (events/snapshot.py) by `head` and
`more`. No value is made a text as a whole first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from bt_actions.utilities.plain_data import field_of, item_of, scalar

MESSAGE = 300
"""Characters of a message: three lines of a terminal."""
LONG = 200
"""Characters of a value; longer ones are cut."""

_ALL = 20
"""Items of a list that are all shown; of a longer list, the first ones and the number are."""
_FIRST = 3
_NOTHING = object()
Part = tuple[str, object]
"""A text, and a value that follows it (or `_NOTHING`)."""


def brief(value: object) -> str:
    """Return a value for people, short however large it is; a text without quotes."""
    return fit(value, LONG) if isinstance(value, str) else shorten(value, LONG)


def scalars(fields: Iterable[tuple[str, object]], named: Callable[[str, int], str]) -> str:
    """Return the first four scalar fields as ``position 0.25, status FAULT``.

    `named` gives the text of a whole number: the name of its constant, where the field has one.
    """
    parts: list[str] = []
    for field, value in fields:
        if isinstance(value, float):
            parts.append(f"{field} {value:.2f}")
        elif isinstance(value, str):
            parts.append(f"{field} {fit(value, 80)}")
        elif isinstance(value, bool):
            parts.append(f"{field} {str(value).lower()}")
        elif isinstance(value, int):
            parts.append(f"{field} {named(field, value)}")
    return ", ".join(parts[:4])


def shorten(value: object, limit: int = MESSAGE) -> str:
    """Return a value in the notation of a tree: ``{x: 1.0, on: true, name: 'a'}``.

    A long list is ``[7, 7, 7, … 4000000 items]``; a text of more than `limit` characters is cut,
    and then ends with an ellipsis. Raises nothing, whatever the value's own methods do.
    """
    text = ""
    stack: list[Iterator[Part]] = [iter((("", value),))]
    while stack and len(text) <= limit:
        try:
            before, item = next(stack[-1])
        except StopIteration:
            stack.pop()
            continue
        except Exception:  # noqa: BLE001 - a value's own methods may raise anything
            stack.pop()
            before, item = "…", _NOTHING
        text += before
        if item is _NOTHING:
            continue
        try:
            parts = _parts(item)
        except Exception:  # noqa: BLE001 - as above
            parts = None
        if parts is None:
            text += _scalar(item, limit)
        else:
            stack.append(parts)
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


def fit(text: str, limit: int = MESSAGE) -> str:
    """Return a message, a long one without its middle: the end often says what to do."""
    if len(text) <= limit:
        return text
    tail = limit // 3
    return f"{text[: limit - tail - 3]} … {text[-tail:]}"


def given_fields(message: object) -> dict[str, object]:
    """Return the fields of a ROS message that differ from a new one, by their names."""
    fields = getattr(message, "get_fields_and_field_types", dict[str, str])()
    plain = type(message)() if fields else None
    given: dict[str, object] = {}
    for name in fields:
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            if inner := given_fields(value):
                given[name] = inner
        elif not _equal(value, getattr(plain, name)):
            given[name] = value
    return given


def _equal(value: object, other: object) -> bool:
    equal = value == other
    return bool(equal.all() if hasattr(equal, "all") else equal)  # numpy: one for each item


def _parts(value: object) -> Iterator[Part] | None:
    """Return the parts of a value that holds others; None for any other value."""
    fields = getattr(type(value), "get_fields_and_field_types", None)
    if fields is not None:
        types = fields()
        return _braced((f"{name}: ", field_of(value, name, types)) for name in types)
    if isinstance(value, Mapping):
        return _braced((f"{key if isinstance(key, str) else _scalar(key, 40)}: ", item)
                       for key, item in value.items())  # fmt: skip
    is_array = type(value).__module__ in ("array", "numpy") and getattr(value, "shape", True)
    is_bytes = isinstance(value, bytes | bytearray) and len(value) != 1  # one is a byte of ROS
    if isinstance(value, list | tuple) or is_array or is_bytes:
        return _listed(value)  # type: ignore[arg-type]
    more = getattr(value, "more", None)
    return _cut(value.head, more) if isinstance(more, int) else None  # type: ignore[attr-defined]


def _braced(members: Iterator[Part]) -> Iterator[Part]:
    yield "{", _NOTHING
    for at, (name, item) in enumerate(members):
        yield f", {name}" if at else name, item
    yield "}", _NOTHING


def _cut(head: object, more: int) -> Iterator[Part] | None:
    """Return the beginning of a cut value, and a note of the rest."""
    if isinstance(head, str):
        return iter(((repr(f"{head}…"), _NOTHING),))
    if isinstance(head, Mapping):
        return _parts({**head, "…": f"{more} more"})
    return _listed(head, more)  # type: ignore[arg-type]


def _listed(items: list[object], more: int = 0) -> Iterator[Part]:
    size = len(items) + more
    shown = size if size <= _ALL else min(_FIRST, len(items))
    yield "[", _NOTHING
    for at in range(shown):
        yield ", " if at else "", item_of(items, at)
    yield f", … {size} items]" if shown < size else "]", _NOTHING


def _scalar(value: object, limit: int) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    try:
        if isinstance(value, str):
            return repr(value[: limit + 1])
        if isinstance(value, bytes):
            return str(value[0])
        return repr(scalar(value))
    except Exception:  # noqa: BLE001 - as above
        return f"<{type(value).__name__}>"
