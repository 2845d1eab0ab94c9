"""A state as JSON and back: for a reader that has not seen the events before.

Each field is written as its type says, and values as events/wire.py writes them. Several places of
a state hold the same node, the same story of an action or a goal, or the same failure. Each of
these is written once, in a list of objects, and every other place has its number there.
"""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from bt_actions.events.kinds import Node, RunBegan
from bt_actions.events.wire import WireError, packed, reader_of
from bt_actions.story.actions import ActionStory, GoalStory
from bt_actions.story.failures import Failure, Warned
from bt_actions.story.state import KEPT, NodeStory, State

_SHARED = {each.__name__: each for each in (Node, GoalStory, ActionStory, Failure)}
_OWN = (RunBegan, State, NodeStory, Warned)
"""Kinds that hold shared objects, and are written field by field."""
_MADE_ANEW = "_called"
"""The field of a state that follows from the others."""
_NO_STATE = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    RecursionError,
)
"""The errors of a text that is no state."""
_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
_Writer = Callable[[Any, "_Objects"], Any]
_Reader = Callable[[Any, list[Any]], Any]


def to_json(state: State) -> str:
    """Return a state as one line of JSON."""
    objects = _Objects()
    data = _codec(State)[0](state, objects)
    pieces = _ENCODER.iterencode({"objects": objects.written, "state": data})
    return "".join(pieces)  # json.dumps would hold Python's lock throughout: a tick may want it


def from_json(text: str) -> State:
    """Return the state of a text; raises WireError."""
    try:
        data, objects = json.loads(text), list[Any]()
        for name, fields in data["objects"]:
            objects.append(_fields(_SHARED[name])[1](fields, objects))
        state: State = _codec(State)[1](data["state"], objects)
    except _NO_STATE as error:
        raise WireError(f"no state: {type(error).__name__} {error}") from error
    if state.began is None or state.root not in state.nodes or not _is_tree(state.nodes):
        raise WireError("no state: its nodes are no tree")
    named = state._names.keys()  # noqa: SLF001 - the fields of a state are all that is kept
    if not named >= {*state.nodes, *(each.node.id for each in state.actions)}:
        raise WireError("no state: nodes have no names")
    return state


def _is_tree(nodes: dict[int, NodeStory]) -> bool:
    """Return whether all nodes below one have higher numbers, and one parent each."""
    return all(
        number == story.node.id
        and (story.node.parent or 0) < number
        and len(set(story.children)) == len(story.children)
        and all(
            each > number and each in nodes and nodes[each].node.parent == number
            for each in story.children
        )
        for number, story in nodes.items()
    )


class _Objects:
    """The writer of shared objects, each behind those that it holds."""

    def __init__(self) -> None:
        self.written: list[tuple[str, Any]] = []
        self._numbers: dict[int, int] = {}

    def number_of(self, held: Any) -> int:
        if id(held) not in self._numbers:
            kind = type(held)
            fields = _fields(kind)[0](held, self)  # type: ignore[arg-type]  # a class is hashable
            self._numbers[id(held)] = len(self.written)
            self.written.append((kind.__name__, fields))
        return self._numbers[id(held)]


@lru_cache(maxsize=256)
def _codec(hint: Any) -> tuple[_Writer, _Reader]:
    """Return the writer and the reader of fields of this type."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SHARED.values():
        return (lambda held, objects: objects.number_of(held)), (
            lambda data, objects: _shared(objects[data], hint)
        )
    if hint in _OWN:
        return _fields(hint)
    if origin in (typing.Union, types.UnionType) and inner[-1] is type(None):
        write, read = _codec(inner[0])
        return (lambda held, objects: None if held is None else write(held, objects)), (
            lambda data, objects: None if data is None else read(data, objects)
        )
    if origin is dict:
        (key, read_key), (write, read) = _codec(inner[0]), _codec(inner[1])
        return (
            lambda held, objects: [[key(k, objects), write(v, objects)] for k, v in held.items()]
        ), lambda data, objects: {read_key(k, objects): read(v, objects) for k, v in data}
    if origin in (list, deque) or (origin is tuple and inner[-1] is Ellipsis):
        write, read = _codec(inner[0])
        whole = {"maxlen": KEPT} if origin is deque else {}
        return (lambda held, objects: [write(each, objects) for each in held]), (
            lambda data, objects: origin((read(each, objects) for each in data), **whole)
        )
    if origin is tuple:
        parts = [_codec(each) for each in inner]
        return (
            lambda held, objects: [w(v, objects) for (w, _), v in zip(parts, held, strict=True)]
        ), lambda data, objects: tuple(r(v, objects) for (_, r), v in zip(parts, data, strict=True))
    read_value = reader_of(hint)
    return (lambda held, objects: packed(held)), (lambda data, objects: read_value(data))


@lru_cache(maxsize=16)
def _fields(kind: Any) -> tuple[_Writer, _Reader]:
    hints = typing.get_type_hints(kind)
    names = [each.name for each in dataclasses.fields(kind) if each.name != _MADE_ANEW]

    def write(held: Any, objects: _Objects) -> dict[str, Any]:
        return {name: _codec(hints[name])[0](getattr(held, name), objects) for name in names}

    def read(data: Any, objects: list[Any]) -> Any:
        return kind(**{name: _codec(hints[name])[1](data[name], objects) for name in names})

    return write, read


def _shared(held: Any, kind: type) -> Any:
    if not isinstance(held, kind):
        raise WireError(f"{kind.__name__} is needed")
    return held
