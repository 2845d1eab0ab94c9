"""The whole records of an MCAP file, also of one that is cut, damaged or still written.

A damaged length hides the beginning of the next record. The reader looks for that beginning, and
the damage costs one record. Passed-over bytes are reported; nothing is read of a chunk or an
attachment with a wrong checksum. Memory is bounded by the longest record that is read, whatever the
file claims.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import zstandard

MAGIC = b"\x89MCAP0\r\n"
LONGEST = 64_000_000
"""Bytes of one record; longer ones are passed over."""
_WINDOW = 1_000_000
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQII")
SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT = 3, 4, 5, 6, 9
_LAST = 15
"""The highest kind of record."""
_LIKELY = re.compile(rb"[\x01-\x0f][\s\S]{4}\x00{4}")
"""The beginning of a record whose length has 32 bits at most."""


class Message(NamedTuple):
    """A message of a channel."""

    channel: int
    log_time: int
    """Nanoseconds since 1970."""
    publish_time: int
    sequence: int
    data: bytes


class Schema(NamedTuple):
    """The type of channels."""

    number: int
    name: str
    encoding: str
    data: bytes


class Channel(NamedTuple):
    """A topic."""

    number: int
    schema: int
    topic: str
    encoding: str


class Attachment(NamedTuple):
    """A file beside the messages."""

    name: str
    media_type: str
    log_time: int
    data: bytes


class Damage(NamedTuple):
    """A part of the file that was passed over."""

    why: str
    size: int
    """Its bytes."""


Record = Message | Schema | Channel | Attachment | Damage


class NoMcap(ValueError):
    """A file that does not begin as MCAP does."""


def records(file: BinaryIO) -> Iterator[Record]:
    """Yield the records with content, and each damage. Raises NoMcap, OSError."""
    begin = file.read(len(MAGIC))
    if not MAGIC.startswith(begin):
        raise NoMcap("no MCAP file")
    for framed in _framed(file):
        if isinstance(framed, Damage):
            yield framed
        else:
            yield from _opened(*framed)


def message_record(
    channel: int, sequence: int, log_time: int, publish_time: int, data: bytes
) -> bytes:
    """Return a message as it stands in a file; a writer of any MCAP takes ten times as long."""
    size = _MESSAGE.size + len(data)
    head = _HEAD.pack(MESSAGE, size)
    return head + _MESSAGE.pack(channel, sequence, log_time, publish_time) + data


def whole_length(data: bytes) -> int:
    """Return the number of bytes, of those read of a file so far, that are records or damage."""
    at = len(MAGIC) if data.startswith(MAGIC) else 0
    while at + _HEAD.size <= len(data):
        _, length = _HEAD.unpack_from(data, at)
        if length > LONGEST:  # no more data will make it whole
            return len(data)
        end = at + _HEAD.size + length
        if end > len(data):
            break
        at = end
    return at


def _opened(kind: int, payload: bytes) -> Iterator[Record]:
    """Yield the record of a payload, or those of a chunk, up to a damage."""
    try:
        if kind == MESSAGE:
            channel, sequence, log, publish = _MESSAGE.unpack_from(payload)
            yield Message(channel, log, publish, sequence, payload[_MESSAGE.size :])
        elif kind == CHUNK:
            for inner, each in _split(_unpacked(payload)):
                if inner != CHUNK:
                    yield from _opened(inner, each)
        elif kind == SCHEMA:
            (number,) = struct.unpack_from("<H", payload)
            name, at = _text(payload, 2)
            encoding, at = _text(payload, at)
            (size,) = struct.unpack_from("<I", payload, at)
            yield Schema(number, name, encoding, payload[at + 4 : at + 4 + size])
        elif kind == CHANNEL:
            number, schema = struct.unpack_from("<HH", payload)
            topic, at = _text(payload, 4)
            yield Channel(number, schema, topic, _text(payload, at)[0])
        elif kind == ATTACHMENT:
            (log,) = struct.unpack_from("<Q", payload)
            _check(payload[:-4], int.from_bytes(payload[-4:], "little"))
            name, at = _text(payload, 16)
            media, at = _text(payload, at)
            (size,) = struct.unpack_from("<Q", payload, at)
            yield Attachment(name, media, log, payload[at + 8 : at + 8 + size])
    except (struct.error, ValueError, RuntimeError, zstandard.ZstdError) as error:
        yield Damage(str(error), _HEAD.size + len(payload))


def _text(payload: bytes, at: int) -> tuple[str, int]:
    """Return a text with its length before it, and its end."""
    (size,) = struct.unpack_from("<I", payload, at)
    end = at + 4 + size
    if end > len(payload):
        raise ValueError("a text is cut")
    return payload[at + 4 : end].decode("utf-8", "replace"), end


def _unpacked(payload: bytes) -> bytes:
    """Return the records of a chunk."""
    _, _, size, crc, length = _CHUNK.unpack_from(payload)
    if size > LONGEST:
        raise ValueError("a chunk is too large")
    at = _CHUNK.size + length
    packing = payload[_CHUNK.size : at]
    data = payload[at + 8 :]
    if packing == b"zstd":
        if zstandard.frame_content_size(data) not in (-1, size):  # zstandard would believe the size
            raise ValueError("a chunk is of another size")
        data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    elif packing:
        raise ValueError("a chunk is packed in an unknown way")
    _check(data, crc)
    return data


def _check(data: bytes, crc: int) -> None:
    """Raise ValueError for data that do not fit their checksum; 0 is none."""
    if crc and zlib.crc32(data) != crc:
        raise ValueError("a checksum is wrong")


def _split(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the records within a chunk."""
    at = 0
    while at + _HEAD.size <= len(data):
        kind, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size + length
        if at > len(data):
            raise ValueError("a record in a chunk is cut")
        yield kind, data[at - length : at]


def _framed(file: BinaryIO) -> Iterator[tuple[int, bytes] | Damage]:
    """Yield the records of a file, and after a damage the next ones.

    The length of a record is believed unless another record begins before it ends.
    """
    rest, at, is_end, lost = b"", 0, False, 0
    while True:
        while len(rest) - at < _HEAD.size and not is_end:
            rest, at, is_end = _more(file, rest, at, _WINDOW)
        if len(rest) - at < _HEAD.size:
            if lost or rest[at:] not in (b"", MAGIC):
                yield Damage("a record is cut, or its length is damaged", lost + len(rest) - at)
            return
        kind, length = _HEAD.unpack_from(rest, at)
        end = at + _HEAD.size + length
        is_likely = 0 < kind <= _LAST and length <= LONGEST
        while is_likely and len(rest) < end + _HEAD.size and not is_end:
            missing = end + _HEAD.size - len(rest)
            end, at_before = end - at, at
            rest, at, is_end = _more(file, rest, at_before, max(missing, _WINDOW))
        is_whole = is_likely and len(rest) >= end
        next_one = end if is_whole and _follows(rest, end) else _found(rest, at + 1)
        if is_whole and not 0 <= next_one < end:  # else its length leads beyond the next one
            if lost:
                yield Damage("the length of a record is damaged", lost)
            yield kind, rest[at + _HEAD.size : end]
            at, lost = end, 0
            continue
        before = at
        if next_one >= 0:
            at = next_one
        elif is_end:
            at = len(rest)
        else:  # nothing likely in sight: keep the possible beginning of a record
            at = max(at + 1, len(rest) - _HEAD.size)
        lost += at - before


def _follows(rest: bytes, end: int) -> bool:
    """Return whether a record, the magic or nothing begins at `end`."""
    after = rest[end : end + len(MAGIC)]
    return after in (b"", MAGIC) or _LIKELY.match(rest, end) is not None


def _more(file: BinaryIO, rest: bytes, at: int, size: int) -> tuple[bytes, int, bool]:
    """Read on; return the bytes from `at` on, their new place, and whether they are all."""
    data = file.read(size)
    return rest[at:] + data, 0, not data


def _found(rest: bytes, at: int) -> int:
    """Return the place of the next record with a record, or the end, behind it; -1 for none."""
    while match := _LIKELY.search(rest, at):
        at = match.start()
        _, length = _HEAD.unpack_from(rest, at)
        end = at + _HEAD.size + length
        if end <= len(rest) and _follows(rest, end):
            return at
        at += 1
    return -1
