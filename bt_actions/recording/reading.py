"""The reading of a recorded run: its events in order, and the state behind missing files.

The file may be a stranger's. The reader passes over a damaged record, an unreadable event and a
number that goes back, and counts them; names and values without end are an error.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, TypeAlias

from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    Event,
    EventsLost,
    FeedbackCame,
    GoalChanged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    RunBegan,
    ServerSeen,
    VariableWritten,
    WireError,
    from_line,
)
from bt_actions.goals.policy import End
from bt_actions.recording.folders import parts_of
from bt_actions.recording.layout import (
    CHANNELS,
    EVENTS,
    HEARTBEAT,
    LAYOUTS,
    STATE,
    TRANSITIONS,
    BadMessage,
    Layout,
    decode,
    nanoseconds,
)
from bt_actions.recording.mcap_records import (
    Attachment,
    Channel,
    Damage,
    Message,
    NoMcap,
    Schema,
    records,
)
from bt_actions.recording.writing import STATUSES
from bt_actions.story.actions import DONE
from bt_actions.story.keeping import from_json
from bt_actions.story.state import State

MOST_NAMES = 1_000_000
"""Nodes, variables, servers and goals of one run that are read."""
MOST_KEPT = 100_000_000
"""Bytes of the events whose values a state of the run keeps at once, and `_ITEM` for each item."""
_ITEM = 50
DEEPEST = 500
"""Nodes from the root down to any node; a tree file has 200 at most."""
LAST = 2**53 - 1
"""The highest number of an event, which JSON holds in every language, and no run reaches."""
MOST_BYTES = 100_000_000
"""Bytes of all tree files and other attachments."""
_STATUS = {number: status for status, number in STATUSES.items()}
_BY_NUMBER = {number: LAYOUTS[topic] for topic, number in CHANNELS.items()}
_BY_TYPE = {layout.type: layout for layout in LAYOUTS.values()}
_EVENT, _TRANSITION = LAYOUTS[EVENTS], LAYOUTS[TRANSITIONS]
_STATE, _HEARTBEAT = LAYOUTS[STATE], LAYOUTS[HEARTBEAT]
Item: TypeAlias = Event | State


class RecordingError(ValueError):
    """A file that is no recording, or cannot be read."""


class Recording:
    """One recorded run, read from its files in order.

    Args:
        first: its first file, or a bag that holds the events of a run.
        run_id: the run of a bag that is meant; its first one if not given.
    """

    def __init__(self, first: Path, run_id: str = "") -> None:
        self.first, self._run_id = first, run_id
        self.sources: dict[str, str] = {}
        """The tree files by path, as they were recorded."""
        self.damaged = 0
        """Messages that were passed over, and parts of its files that may have held several."""
        self.damaged_bytes = 0
        """Their bytes; those of a chunk as it is packed."""
        self.last_beat: float | None = None
        """The last sign of life of the process, in seconds since 1970."""
        self.tick = 0.0
        """Seconds of the tick at that time."""
        self._number = 0
        """The number of the latest event."""
        self._before = self._known = 0
        """The number of the event before it, and the latest at the beginning of the present
        file."""
        self._base: int | None = None
        """Nanoseconds by which the log's time is ahead of the steady clock."""
        self._names: set[str] = set()
        self._kept: dict[tuple[int, str], int] = {}
        """The bytes that a state keeps of each goal of a node, and of each variable."""
        self._kept_bytes = 0
        self._done: defaultdict[int, set[str]] = defaultdict(set)
        """The goals by node that a state forgets once the node begins anew."""
        self._nodes = 0
        """The number of nodes that were added."""
        self._depths: dict[int, int] = {}
        """How deep each node lies, the highest number last."""
        self._attachments = 0
        """Bytes of the attachments."""
        self.begin_part()

    @property
    def damage(self) -> str:
        """The damage in words; "" for none."""
        parts = "1 part" if self.damaged == 1 else f"{self.damaged} parts"
        verb = "is" if self.damaged == 1 else "are"
        told = f"{parts} of the recording ({self.damaged_bytes} bytes) {verb} damaged"
        return f"{told} or of another version" if self.damaged else ""

    def state(self) -> State:
        """Return the state of the run at the end of its recording. Raises RecordingError."""
        state = State()
        for item in self.items():
            if isinstance(item, State):
                state = item
            else:
                state.fold(item)
        if state.began is None:
            raise RecordingError(f"{self.first} holds no run")
        return state

    def items(self) -> Iterator[Item]:
        """Yield each event, once, in order; and a whole state where events before it are missing.

        An EventsLost with the number of missing events comes before such a state. Raises
        RecordingError.
        """
        for part in parts_of(self.first) or [self.first]:
            try:
                with part.open("rb") as file:
                    self.begin_part()
                    yield from self.items_in(file)
            except NoMcap as error:
                raise RecordingError(f"{part} is no recording: {error}") from error
            except OSError as error:
                raise RecordingError(f"{part} cannot be read: {error.strerror}") from error

    def begin_part(self) -> None:
        """Take note that another file follows, with numbers of its own for topics."""
        self._layouts, self._schemas = dict(_BY_NUMBER), dict[int, str]()
        self._known = self._number

    def items_in(self, file: BinaryIO) -> Iterator[Item]:
        """Yield the items of a file, or of more of it; raises NoMcap, OSError, RecordingError."""
        for record in records(file):
            before = self.damaged
            if isinstance(record, Message):
                layout = self._layouts.get(record.channel)
                for item in () if layout is None else self._taken(record, layout):
                    self._check(item)
                    self._weigh(item, record.data)
                    yield item
            elif isinstance(record, Schema):
                self._schemas[record.number] = record.name
            elif isinstance(record, Channel):
                found = _BY_TYPE.get(self._schemas.get(record.schema, ""))
                if found is not None:
                    self._layouts[record.number] = found
            elif isinstance(record, Damage):
                self.damaged += 1
                self.damaged_bytes += record.size
            else:
                self._attached(record)
            if self.damaged > before and isinstance(record, Message | Attachment):
                self.damaged_bytes += len(record.data)

    # Within

    def _attached(self, attachment: Attachment) -> None:
        self._attachments += len(attachment.data)
        if self._attachments > MOST_BYTES:
            self.damaged += 1
            return
        path = attachment.name.removeprefix("trees/")
        if path != attachment.name:
            self.sources[path] = attachment.data.decode("utf-8", "replace")

    def _taken(self, message: Message, layout: Layout) -> Iterator[Item]:
        """Yield the event or the state of a message, unless it is known."""
        try:
            head, texts = decode(layout, message.data)
            if layout is _HEARTBEAT and self._base is not None:
                self.last_beat, self.tick = message.log_time * 1e-9, float(head[-1])  # type: ignore[arg-type]
            elif layout is _TRANSITION:
                yield from self._transition(message, head)
            elif layout is _EVENT and self._is_meant(head[0]):
                yield from self._event(texts[1], message.log_time, _hex(head[0]))
            elif layout is _STATE and self._is_meant(head[0]):
                yield from self._state(texts[1], message.log_time)
            elif layout is _STATE:
                self._base = None  # the rest is of another run
        except (BadMessage, WireError, TypeError, ValueError):
            self.damaged += 1

    def _is_meant(self, run_id: object) -> bool:
        return not self._run_id or _hex(run_id) == self._run_id

    def _event(self, text: str, log_time: int, run_id: str) -> Iterator[Item]:
        if not text:  # values that were hidden from the recorder of a bag
            return
        event = from_line(text)
        self._base = log_time - nanoseconds(event.at.steady)
        if not self._goes_on(event.at.number):
            return
        if isinstance(event, EventsLost):  # it has the number of the event behind it
            self._number = self._before
        if isinstance(event, NodesAdded):
            self._number_nodes(event.nodes, self._depths)
        if isinstance(event, RunBegan):
            self._number_nodes(event.nodes, {})
            self._run_id = event.run_id if event.run_id == run_id else ""
            event = replace(event, sources=dict(self.sources))
        yield event

    def _goes_on(self, number: int) -> bool:
        """Take note of the number of an event; return False for one that goes back.

        A damaged number that is far ahead costs no event behind it.
        """
        if number > LAST:
            self.damaged += 1
            return False
        if number > self._number:
            self._before = self._number
        elif not self._before < number < self._number:
            self.damaged += number > self._known  # else it is read anew
            return False
        self._number = number
        return True

    def _number_nodes(self, nodes: Iterable[Node], depths: dict[int, int]) -> None:
        """Refuse nodes that are no tree beside those of `depths`, or are too deep in it.

        Numbers grow, and parents come before their children.
        """
        for node in nodes:
            is_above = next(reversed(depths), 0) < node.id and (node.parent or 0) < node.id
            if not is_above or not 0 <= (node.index or 0) < node.id:
                raise WireError("no tree")
            depths[node.id] = depths.get(node.parent or 0, 0) + 1
            if depths[node.id] > DEEPEST:
                raise WireError("the tree is too deep")
        if not depths:
            raise WireError("a tree has nodes")
        self._depths = depths

    def _transition(self, message: Message, head: tuple[object, ...]) -> Iterator[Item]:
        number, seconds, rest, node, status, by_itself = head
        if self._base is None or number == self._number or not isinstance(number, int):
            return  # the event before has more of the same
        if not self._goes_on(number):
            return
        steady = (message.log_time - self._base) / 10**9
        ros = (int(seconds) * 10**9 + int(rest)) / 10**9  # type: ignore[call-overload]
        at = Moment(number, steady, message.publish_time / 10**9, ros)
        told = _STATUS.get(status, Status.INVALID)  # type: ignore[call-overload]
        yield NodeChanged(at, int(node), told, "", bool(by_itself))  # type: ignore[call-overload]

    def _state(self, text: str, log_time: int) -> Iterator[Item]:
        state = from_json(text)
        if state.now is None:
            return
        self._base = log_time - nanoseconds(state.now.steady)
        if not self._goes_on(state.now.number):
            return
        self._number_nodes((state.nodes[each].node for each in sorted(state.nodes)), {})
        lost = self._number - self._before
        self._run_id = state.began.run_id if state.began is not None else ""
        yield EventsLost(state.now, lost)
        yield state

    def _check(self, item: Item) -> None:
        """Bound the memory that a hostile file can claim."""
        if isinstance(item, VariableWritten):
            self._names.add(item.name)
        elif isinstance(item, ServerSeen):
            self._names.add(item.server)
        elif isinstance(item, GoalChanged):
            self._names.add(item.goal_id)
        elif isinstance(item, NodesAdded):
            self._nodes += len(item.nodes)
        if len(self._names) + self._nodes > MOST_NAMES:
            raise RecordingError(f"{self.first} has more names than a run can have")

    def _weigh(self, item: Item, data: bytes) -> None:
        """Bound the values that a state keeps, with the rules by which it forgets goals."""
        if isinstance(item, GoalChanged):
            key, done = (item.node, item.goal_id), self._done[item.node]
            if key not in self._kept and item.attempt <= 1 and item.outcome is None:
                self._kept_bytes -= sum(self._kept.pop((item.node, each), 0) for each in done)
                done.clear()
            is_open = item.state != DONE or item.end in (End.SERVER_GONE, End.UNKNOWN)
            (done.discard if is_open else done.add)(item.goal_id)
        elif isinstance(item, FeedbackCame | AttemptEnded):
            key = item.node, item.goal_id
        elif isinstance(item, VariableWritten):
            key = 0, item.name
        else:
            return
        before, size = self._kept.get(key, 0), len(data) + _ITEM * sum(map(data.count, b",[{"))
        is_more = isinstance(item, GoalChanged | AttemptEnded)  # beside what is known of the goal
        self._kept[key] = before + size if is_more else max(before, size)
        self._kept_bytes += self._kept[key] - before
        if self._kept_bytes > MOST_KEPT:
            raise RecordingError(f"{self.first} has more values than a run can have")


def _hex(run_id: object) -> str:
    return run_id.hex() if isinstance(run_id, bytes) else ""
