"""Finishes the files of a run that is over: packed in chunks, with an index, as other readers want.

Run as a process of its own (``python -m bt_actions.recording.finishing FILE``) at low priority, or
on a thread of a process that ticks no tree.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from mcap.writer import CompressionType, Writer

from bt_actions.recording.folders import held, parts_of
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

QOS = {"offered_qos_profiles": ""}
"""What readers of bags want of a channel."""
AT_ONCE = 1_000_000
"""Bytes that take less than 0.3 s to finish."""
_FOOTER = 2
_END = 9 + 20 + len(MAGIC)
"""Bytes of the footer and what follows it."""
_CHUNK = 256_000
_NICE = 10


def is_finished(part: Path) -> bool:
    """Whether a file ends as MCAP does. Raises OSError."""
    with part.open("rb") as file:
        if file.seek(0, os.SEEK_END) < _END:
            return False
        file.seek(-_END, os.SEEK_END)
        end = file.read()
    return end[0] == _FOOTER and end.endswith(MAGIC)


def finish(first: Path) -> bool:
    """Finish the files of a run unless somebody writes them; return whether they are finished.

    Each file is replaced as a whole. Raises OSError.
    """
    with held(first.parent), held(first, alone=True) as alone:
        if alone:
            for part in parts_of(first):
                if not is_finished(part):
                    _rewrite(part)
        return alone


def finish_beside(first: Path, *, may_wait: bool) -> subprocess.Popen[bytes] | None:
    """Finish a run's files without holding up a tick: large ones in a process, which is returned.

    Small ones are finished here where the caller may wait, and else when they are opened. Raises
    OSError.
    """
    if sum(part.stat().st_size for part in parts_of(first)) <= AT_ONCE:
        if may_wait:
            finish(first)
        return None
    return subprocess.Popen(
        [sys.executable, "-P", "-m", __name__, str(first)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _rewrite(part: Path) -> None:
    """Write all whole records of a file to another one, and put that in its place."""
    new = part.with_name(f".{part.name}.new")
    descriptor = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file, part.open("rb") as source:
            writer = Writer(file, chunk_size=_CHUNK, compression=CompressionType.ZSTD)
            writer.start(profile="ros2", library="bt_actions")
            _copy(records(source), writer)
            writer.finish()
            file.flush()
            os.fsync(descriptor)
        new.replace(part)
    except NoMcap:
        new.unlink(missing_ok=True)
    except BaseException:
        new.unlink(missing_ok=True)
        raise


def _copy(found: Iterable[Record], writer: Writer) -> None:
    """Write records anew; schemas and channels get the numbers that the writer gives them."""
    schemas, channels = dict[int, int](), dict[int, int]()
    for each in found:
        match each:
            case Message() if each.channel in channels:
                number = channels[each.channel]
                writer.add_message(
                    number, each.log_time, each.data, each.publish_time, each.sequence
                )
            case Schema() if each.number not in schemas:
                number = writer.register_schema(each.name, each.encoding, each.data)
                schemas[each.number] = number
            case Channel() if each.number not in channels and each.schema in schemas:
                schema = schemas[each.schema]
                number = writer.register_channel(each.topic, each.encoding, schema, QOS)
                channels[each.number] = number
            case Attachment():
                time = each.log_time
                writer.add_attachment(time, time, each.name, each.media_type, each.data)


if __name__ == "__main__":
    os.nice(_NICE)
    finish(Path(sys.argv[1]))
