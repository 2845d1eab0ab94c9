"""The finish of the files of a run that is over.

Packed in chunks, with an index, for other readers.

The finish runs as a process of its own (``python -m bt_actions.recording.finishing FILES``) at low
priority, or on a thread of a process that ticks no tree.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.recording.folders import held, parts_of
from bt_actions.recording.layout import CHANNELS, LAYOUTS, QOS, schema_of
from bt_actions.recording.mcap_records import (
    MAGIC,
    Attachment,
    Channel,
    Message,
    NoMcap,
    Record,
    Schema,
    records,
)
from bt_actions.utilities.whole_file import replacing

if TYPE_CHECKING:
    from mcap.writer import Writer

AT_ONCE = 1_000_000
"""Bytes that take less than 0.3 s to finish."""
_FOOTER = 2
_END = 9 + 20 + len(MAGIC)
"""Bytes of the footer and the magic behind it."""
_CHUNK = 16_000
"""Bytes that are packed as one: what a damaged byte costs."""
_NICE = 10


def is_finished(part: Path) -> bool:
    """Return whether a file ends as MCAP does. Raises OSError."""
    with part.open("rb") as file:
        if file.seek(0, os.SEEK_END) < _END:
            return False
        file.seek(-_END, os.SEEK_END)
        end = file.read()
    return end[0] == _FOOTER and end.endswith(MAGIC)


def finish(first: Path) -> bool:
    """Finish the files of a run unless a process writes them; return whether they are finished.

    Each file is replaced as a whole; a damaged one stays as it is. Raises OSError.
    """
    with held(first.parent, waits=True), held(first, alone=True) as alone:
        parts = reversed(parts_of(first)) if alone else ()  # a lock is lost with the replaced file
        done = [is_finished(part) or _rewrite(part) for part in parts]
    return alone and all(done)


def finish_beside(*firsts: Path, may_wait: bool) -> subprocess.Popen[bytes] | None:
    """Finish runs without a delay of ticks: large ones in one process, which is returned.

    Small ones are finished here where the caller may wait, and otherwise when they are opened. A
    folder that cannot be written stays as it is. Raises OSError where no process begins.
    """
    large = list[str]()
    for first in firsts:
        with contextlib.suppress(OSError):
            if sum(part.stat().st_size for part in parts_of(first)) > AT_ONCE:
                large.append(str(first))
            elif may_wait:
                finish(first)
    if not large:
        return None
    return subprocess.Popen(
        [sys.executable, "-P", "-m", __name__, *large],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _rewrite(part: Path) -> bool:
    """Replace a file by one with its records packed; return False for a file that is not ours."""
    from mcap.writer import CompressionType, Writer  # a slow import, for ended runs alone

    try:
        with replacing(part) as file, part.open("rb") as source:
            writer = Writer(file, chunk_size=_CHUNK, compression=CompressionType.ZSTD)
            writer.start(profile="ros2", library="bt_actions")
            _copy(records(source), writer)
            writer.finish()
            file.flush()
            os.fsync(file.fileno())
    except _NotOurs:
        return False
    return True


class _NotOurs(ValueError):
    """A file unlike those of our writer: other readers may find more in it."""


def _copy(found: Iterator[Record], writer: Writer) -> None:
    """Write records anew; raise _NotOurs for any that our writer has not written."""
    ours, channels = set[Record](), dict[int, int]()
    for topic, number in CHANNELS.items():
        name, data = LAYOUTS[topic].type, schema_of(topic)
        schema = writer.register_schema(name, "ros2msg", data)
        channels[number] = writer.register_channel(topic, "cdr", schema, QOS)
        ours |= {Schema(number, name, "ros2msg", data), Channel(number, number, topic, "cdr")}
    try:
        for each in found:
            if isinstance(each, Message) and each.channel in channels:
                number, data = channels[each.channel], each.data
                writer.add_message(number, each.log_time, data, each.publish_time, each.sequence)
            elif isinstance(each, Attachment):
                time = each.log_time
                writer.add_attachment(time, time, each.name, each.media_type, each.data)
            elif each not in ours:
                raise _NotOurs(each)
    except NoMcap as error:
        raise _NotOurs from error


if __name__ == "__main__":
    os.nice(_NICE)
    for each in sys.argv[1:]:
        with contextlib.suppress(OSError):
            finish(Path(each))
