"""Recordings in the hands of others: rosbags, rclpy, and the layout for Foxglove and Lichtblick."""

from __future__ import annotations

import importlib
import json
import random
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bt_actions.events import Event, RunBegan, to_line
from bt_actions.events.bare import bare
from bt_actions.messages.definition import ros2msg
from bt_actions.recording.finishing import finish
from bt_actions.recording.folders import parts_of
from bt_actions.recording.layout import GOALS, LAYOUTS, LOG, STATE, TRANSITIONS, decode, encode
from bt_actions.recording.mcap_records import Channel, Message, records
from bt_actions.recording.reading import Recording
from bt_actions.recording.writing import RunWriter
from bt_actions.story.state import State
from tests.support.every_kind import RUN_ID, every_kind

LAYOUT = Path(__file__).parents[2] / "foxglove" / "bt_actions.json"


@pytest.fixture
def parts(tmp_path: Path) -> list[Path]:
    """The finished files of a long run."""
    first, events = tmp_path / "run.mcap", every_kind(rounds=40)
    writer = RunWriter(first, events[1], size=60_000)  # type: ignore[arg-type]
    for event in events:
        writer.add(event)
        writer.beat(event.at.steady, event.at.wall, event.at.ros, 0.25)
        writer.flush()
    writer.close()
    assert finish(first)
    return parts_of(first)


def ours(file: Path) -> list[tuple[str, int, bytes]]:
    """All messages in the order of the file: topic, log time, bytes."""
    topics, found = dict[int, str](), list[tuple[str, int, bytes]]()
    with file.open("rb") as opened:
        for each in records(opened):
            if isinstance(each, Channel):
                topics[each.number] = each.topic
            elif isinstance(each, Message):
                found.append((topics[each.channel], each.log_time, each.data))
    return found


def plain(value: Any) -> Any:
    """The fields of a message in order, whoever has made its class."""
    if hasattr(value, "sec"):
        return [value.sec, value.nanosec]
    return bytes(value) if hasattr(value, "tobytes") else value


def fields_of(message: Any, names: list[str]) -> list[Any]:
    """The values of a message as our layout has them, a stamp as two."""
    found: list[Any] = []
    for name in names:
        value = plain(getattr(message, name))
        found += value if isinstance(value, list) else [value]
    return found


def with_rosbags(file: Path) -> list[tuple[str, int, bytes, list[Any]]]:
    """All messages as rosbags gives them, deserialized by the schemas in the file."""
    found = []
    with AnyReader([file]) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            names = [each for each in message.__dataclass_fields__ if each != "__msgtype__"]
            names = [each for each in names if not each.isupper()]
            found.append((connection.topic, time, bytes(raw), fields_of(message, names)))
    return found


def all_fields(topic: str, data: bytes) -> list[Any]:
    head, texts = decode(LAYOUTS[topic], data)
    return [*head, *texts]


def test_rosbags_reads_a_finished_run_whole_and_in_order(night: Path) -> None:
    known = ours(night)
    assert [each[:3] for each in with_rosbags(night)] == known
    assert {topic for topic, _, _ in known} == LAYOUTS.keys() - {STATE}


def test_rosbags_deserializes_every_message_with_the_schemas_in_the_files(
    night: Path, parts: list[Path]
) -> None:
    told = set()
    for file in [night, *parts]:
        for topic, _, raw, found in with_rosbags(file):
            fields = all_fields(topic, raw)
            assert found[: len(fields)] == fields, topic
            told.add(topic)
    assert told == LAYOUTS.keys()


@pytest.mark.ros
@pytest.mark.parametrize("topic", LAYOUTS)
@pytest.mark.parametrize("seed", range(8))
def test_rclpy_and_our_bytes_agree_both_ways(topic: str, seed: int) -> None:
    from rclpy.serialization import deserialize_message, serialize_message

    layout, chance = LAYOUTS[topic], random.Random(seed)
    package, _, name = layout.type.split("/")
    kind = getattr(importlib.import_module(f"{package}.msg"), name)
    head = layout.head.unpack(chance.randbytes(layout.head.size))
    texts = ["".join(chance.choices("aø\n中", k=(seed + more) % 5)) for more in range(layout.texts)]
    message = deserialize_message(encode(layout, head, texts), kind)
    fields = fields_of(message, list(message.get_fields_and_field_types()))
    assert fields == [*head, *texts, *([0] if layout.tail else [])]
    assert decode(layout, serialize_message(message)) == (head, texts)


PATH = re.compile(r"(?P<topic>/[\w/]+)(?:\{(?P<filter>\w+)==\d+\})?(?P<fields>(?:\.\w+)*)")
"""What a panel shows: a topic, which of its messages, and which field of these."""


def shown(layout: Any) -> Iterator[str]:
    """The paths that the panels of a layout show."""
    for panel in layout["configById"].values():
        yield from (each["value"] for each in panel.get("paths", ()))
        yield from (panel[key] for key in ("topicToRender", "topicPath") if key in panel)


def test_each_path_of_the_layout_leads_to_a_field_of_the_recording(night: Path) -> None:
    layout = json.loads(LAYOUT.read_text())
    with AnyReader([night]) as reader:
        topics = {each.topic: each.msgtype for each in reader.connections}
        store = reader.typestore
        for path in shown(layout):
            found = PATH.fullmatch(path)
            assert found, path
            fields = store.types[topics[found["topic"]]].__dataclass_fields__
            assert {found["filter"] or "node"} <= fields.keys() or not found["filter"], path
            for name in found["fields"].split(".")[1:]:
                assert name in fields, path
    assert {PATH.match(path)["topic"] for path in shown(layout)} == {TRANSITIONS, GOALS, LOG}  # type: ignore[index]


def test_each_panel_of_the_layout_is_placed() -> None:
    layout = json.loads(LAYOUT.read_text())

    def placed(part: Any) -> Iterator[str]:
        if isinstance(part, str):
            yield part
        else:
            yield from (*placed(part["first"]), *placed(part["second"]))

    assert sorted(placed(layout["layout"])) == sorted(layout["configById"])


def bag_of(folder: Path, topic: str, messages: list[Any]) -> Path:
    """A bag as `ros2 bag record` makes it; return its file."""
    from rclpy.serialization import serialize_message

    kind = type(messages[0])
    name = f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(ros2msg(name), name))
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection(topic, name, typestore=store)
        for number, each in enumerate(messages):
            bag.write(connection, number, serialize_message(each))
    return folder / f"{folder.name}.mcap"


@pytest.mark.ros
@pytest.mark.parametrize("values", [True, False])
def test_a_bag_of_events_is_a_recording_of_each_of_its_runs(tmp_path: Path, values: bool) -> None:
    from bt_actions_interfaces.msg import RunEvent

    def message(event: Event, run_id: str) -> RunEvent:
        event = replace(event, run_id=run_id) if isinstance(event, RunBegan) else event
        told = event if values else bare(event)
        return RunEvent(
            run_id=list(bytes.fromhex(run_id)),
            number=event.at.number,
            kind=type(event).__name__,
            data="" if told is None else to_line(told),
        )

    events, ids = every_kind(), (RUN_ID, "ee" * 16)
    told = [message(each, run_id) for each in events for run_id in ids]
    file = bag_of(tmp_path / "bag", "/bt_actions_serve/events", told)
    began = Recording(file).state().began
    assert began is not None
    assert began.run_id == RUN_ID, "the first"
    for run_id in ids:
        recording = Recording(file, run_id)
        read = [each for each in recording.items() if not isinstance(each, State)]
        known = [each if values else bare(each) for each in events]
        kinds = [type(each) for each in known if each is not None]
        assert [type(each) for each in read] == kinds
        assert [each.run_id for each in read if isinstance(each, RunBegan)] == [run_id]
        assert recording.damaged == 0


@pytest.mark.ros
def test_the_goals_of_a_run_are_found_in_a_bag_as_the_page_says(
    night: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from action_msgs.msg import GoalStatus, GoalStatusArray

    state = Recording(night).state()
    goals = [key for action in state.actions for key in action.goals]
    strange = [*goals, "ab" * 16]
    arrays = []
    for key in strange:
        status = GoalStatus(status=GoalStatus.STATUS_EXECUTING)
        status.goal_info.goal_id.uuid = list(bytes.fromhex(key))
        arrays.append(GoalStatusArray(status_list=[status]))
    bag_of(tmp_path / "my_bag", "/move_robot/_action/status", arrays)
    page = (LAYOUT.parents[1] / "docs" / "recording.md").read_text()
    (code,) = (each for each in re.findall(r"```python\n(.*?)```", page, re.DOTALL)
               if "AnyReader" in each)  # fmt: skip
    monkeypatch.chdir(tmp_path)
    exec(code.replace("pick_and_place", str(night)), {})
    lines = capsys.readouterr().out.splitlines()
    assert [int(line.split()[0]) for line in lines] == list(range(len(goals)))
