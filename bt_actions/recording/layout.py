"""The topics of a recording, and their messages as bytes.

A message is written with its fields in the order of its .msg file: a head of fixed size, texts, and
a tail. The bytes are CDR, little-endian, with zeros in all padding. A transition of a node without
a text takes 25 bytes. docs/recording.md describes each topic for other readers.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from bt_actions.messages.definition import ros2msg

_HEADER = b"\x00\x01\x00\x00"
"""The bytes before each message: CDR, little-endian."""
_LONGEST = 64_000_000
"""Bytes of one text that is read."""


class Layout(NamedTuple):
    """The bytes of one message type."""

    type: str
    """The full name: ``package/msg/Name``."""
    head: struct.Struct
    """The fields of fixed size, padding included."""
    texts: int = 0
    """The number of texts behind the head."""
    tail: bytes = b""
    """The bytes behind the texts, aligned to 4 bytes."""


class BadMessage(ValueError):
    """Bytes that are no message of their topic's type."""


_OWN = "bt_actions_interfaces/msg/"
TRANSITIONS = "/bt_actions/transitions"
GOALS = "/bt_actions/goals"
EVENTS = "/bt_actions/events"
STATE = "/bt_actions/state"
HEARTBEAT = "/bt_actions/heartbeat"
LOG = "/bt_actions/log"
LAYOUTS = {
    TRANSITIONS: Layout(f"{_OWN}NodeTransition", struct.Struct("<QiIIB?")),
    GOALS: Layout(f"{_OWN}GoalTransition", struct.Struct("<QiIII16sB"), 4),
    EVENTS: Layout(f"{_OWN}RunEvent", struct.Struct("<16sQiIIB"), 2),
    STATE: Layout(f"{_OWN}RunState", struct.Struct("<16sQiI"), 2),
    HEARTBEAT: Layout(f"{_OWN}Heartbeat", struct.Struct("<QiId")),
    LOG: Layout("rcl_interfaces/msg/Log", struct.Struct("<iIB"), 4, b"\x00\x00\x00\x00"),
}
"""The layouts by topic."""
CHANNELS = {topic: number for number, topic in enumerate(LAYOUTS, 1)}
"""The number of each topic, and of its schema, in a file that is not finished yet."""
QOS = {"offered_qos_profiles": ""}
"""The fields of a channel that readers of bags want."""


@lru_cache
def schema_of(topic: str) -> bytes:
    """Return the message definition of a topic in the form for other readers."""
    return ros2msg(LAYOUTS[topic].type).encode()


def encode(layout: Layout, head: Sequence[object], texts: Sequence[str] = ()) -> bytes:
    """Return a message as CDR, with the fields of its head, and its texts."""
    data = layout.head.pack(*head)
    if not texts:
        return _HEADER + data
    parts, size = [_HEADER, data], len(data)
    for text in texts:
        raw = text.encode("utf-8", "replace") + b"\x00"
        padding = -size % 4
        parts += [bytes(padding), struct.pack("<I", len(raw)), raw]
        size += padding + 4 + len(raw)
    if layout.tail:
        parts += [bytes(-size % 4), layout.tail]
    return b"".join(parts)


def decode(layout: Layout, data: bytes) -> tuple[tuple[object, ...], list[str]]:
    """Return the fields of a message's head, and its texts. Raises BadMessage."""
    body = memoryview(data)[len(_HEADER) :]
    try:
        head = layout.head.unpack_from(body)
        texts, at = [], layout.head.size
        for _ in range(layout.texts):
            at += -at % 4
            (size,) = struct.unpack_from("<I", body, at)
            at += 4 + size
            if size > _LONGEST or at > len(body):
                raise BadMessage(f"{layout.type} ends within a text")
            texts.append(bytes(body[at - size : at]).rstrip(b"\x00").decode("utf-8", "replace"))
    except struct.error as error:
        raise BadMessage(f"{layout.type} is too short: {error}") from error
    return head, texts


def stamp(seconds: float) -> tuple[int, int]:
    """Return seconds as the two numbers of a builtin_interfaces/Time, within its range."""
    return divmod(min(nanoseconds(seconds), (2**31 - 1) * 10**9), 10**9)


def nanoseconds(seconds: float) -> int:
    """Return seconds in nanoseconds, at least 0; divided by 10**9 they give the same seconds."""
    whole = int(seconds)
    return max(0, whole * 10**9 + round((seconds - whole) * 1e9))
