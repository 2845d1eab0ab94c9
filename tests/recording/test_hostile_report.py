"""A recording is anybody's file: a report of it is a text, or an error in words."""

from __future__ import annotations

import contextlib
import copy
import json
import random
import re
import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from bt_actions import MoveRobot
from bt_actions.cli import main
from bt_actions.cli.commands.report import data
from bt_actions.events import GoalChanged, Node, NodesAdded, to_line
from bt_actions.recording import reading
from bt_actions.recording.folders import summary_of
from bt_actions.recording.layout import CHANNELS, EVENTS, LAYOUTS, STATE, encode
from bt_actions.recording.reading import Recording, RecordingError
from bt_actions.recording.report import markdown, reports, text
from bt_actions.recording.statistics import Statistics
from bt_actions.recording.tape import Tape
from bt_actions.story.keeping import to_json
from bt_actions.story.state import State
from bt_actions.testing import VirtualNetwork, serve_as_recorded
from bt_actions.utilities.plain_text import as_json
from tests.support.every_kind import every_kind
from tests.support.recordings import record
from tests.support.stories import state_of

EXTREMES: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2, 99, 2**63, 10**400, -0.5, 1e300, {"$float": "nan"}, {"$float": "inf"},
    {"$int": "9" * 400}, "", "x", "\x1b[31m\u202e\ud800\n```", "INVALID", "SUCCESS", "DONE",
    "RunTree", [], [1], {}, {"$cut": ["head", 3]},
    {"$cut": [None, {"$float": "inf"}]}, {"$bytes": "!"},
    [[[[[[]]]]]], "x" * 10_000,
)  # fmt: skip


def raw(path: Path, texts: Iterable[str], state: str = "", name: str = "") -> Path:
    """Write texts as if they were events, behind a state, and an attachment of a name."""
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start(profile="ros2", library="tests")
        for layout in LAYOUTS.values():
            schema = writer.register_schema(layout.type, "ros2msg", b"")
            writer.register_channel("/x", "cdr", schema)
        if name:
            writer.add_attachment(0, 0, name, "application/yaml", b"tree: mine\n")
        run = bytes(range(16))
        if state:
            message = encode(LAYOUTS[STATE], (run, 1, 0, 0), ("all", state))
            writer.add_message(CHANNELS[STATE], 0, message, 0)
        for text in texts:
            message = encode(LAYOUTS[EVENTS], (run, 1, 0, 0, 0, 0), ("Kind", text))
            writer.add_message(CHANNELS[EVENTS], 0, message, 0)
        writer.finish()
    return path


def whole(first: Path) -> str:
    """All forms of the report of a file, or the error in words."""
    try:
        found = reports(first)
        lines = [*text(found), *markdown(found), *text(found, full=True)]
        return "\n".join([*lines, as_json([data(each, full=True) for each in found])])
    except RecordingError as error:
        return str(error)


def changed(plain: Any, chance: random.Random, *, alike: bool = False) -> Any:
    """Plain data with an extreme value somewhere in it; with `alike` one of the same type."""
    plain = copy.deepcopy(plain)
    at, places = plain, list[tuple[Any, Any]]()
    waiting = [at]
    while waiting:
        at = waiting.pop()
        keys = list(at) if isinstance(at, dict) else range(len(at))
        places += [(at, key) for key in keys]
        waiting += [at[key] for key in keys if isinstance(at[key], dict | list)]
    for _ in range(1 if alike else chance.randrange(1, 4)):
        holder, key = chance.choice(places)
        same = [each for each in EXTREMES if type(each) is type(holder[key])] if alike else []
        holder[key] = copy.deepcopy(chance.choice(same or EXTREMES))
    return plain


@pytest.mark.parametrize("seed", range(10))
def test_no_event_makes_more_than_an_error_in_words(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    plain = [json.loads(to_line(event)) for event in every_kind(rounds=2)]
    said = 0
    for _ in range(40):
        texts = [
            json.dumps(changed(each, chance) if chance.random() < 0.2 else each) for each in plain
        ]
        said += whole(raw(tmp_path / "run.mcap", texts)).startswith("all: ")
    assert said > 10, "most of them have a report"


@pytest.mark.parametrize("seed", range(10))
def test_no_state_makes_more_than_an_error_in_words(tmp_path: Path, seed: int) -> None:
    chance, events = random.Random(seed), every_kind(rounds=2)
    middle = len(events) // 2
    plain = json.loads(to_json(state_of(events[:middle])))
    texts = [to_line(event) for event in events[middle:]]
    said = 0
    for _ in range(60):
        state = json.dumps(changed(plain, chance, alike=chance.random() < 0.7))
        said += "holds no run" not in whole(raw(tmp_path / "run.mcap", texts, state))
    assert said > 10, "many of them have a report"


def done(words: list[str]) -> None:
    code = main(words)
    assert code in (0, 1, 2)
    if code == 2:
        raise RecordingError("which was said")


def replayed(first: Path, *words: str) -> None:
    done(["replay", str(first), *words])


def played(first: Path) -> None:
    tape = Tape(Recording(first))
    for position in range(0, len(tape), 5):
        tape.seek(position)


def compared(first: Path) -> None:
    good = record(every_kind(rounds=2))
    try:
        done(["diff", str(first), str(good)])
    finally:
        shutil.rmtree(good.parent)


def served(first: Path) -> None:
    leaf = MoveRobot("Move", 1.0, action_name="/move")
    serve_as_recorded(VirtualNetwork(), leaf, first).close()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "reader",
    [
        lambda first: replayed(first, "--plain"),
        lambda first: replayed(first, "--plain", "--verbose"),
        lambda first: replayed(first, "--json"),
        played,
        compared,
        lambda first: Statistics().add(Recording(first).items()),
        served,
    ],
    ids=["lines", "all lines", "json", "played", "diff", "stats", "servers"],
)
def test_no_recording_makes_more_than_an_error_in_words_for_any_reader(
    tmp_path: Path, seed: int, reader: Callable[[Path], None]
) -> None:
    chance, events = random.Random(seed), every_kind(rounds=2)
    middle = len(events) // 2
    texts = [json.loads(to_line(event)) for event in events]
    state, read = json.loads(to_json(state_of(events[:middle]))), 0
    for number in range(20):
        some = [
            json.dumps(changed(each, chance, alike=True) if chance.random() < 0.1 else each)
            for each in texts
        ]
        head = json.dumps(changed(state, chance, alike=True)) if number % 2 else ""
        first = raw(tmp_path / "run.mcap", some[middle:] if head else some, head)
        with contextlib.suppress(RecordingError, RecursionError):
            reader(first)
            read += 1
    assert read > 8, "most of them are read"


@pytest.mark.parametrize(
    "nodes",
    [
        [],
        [[1, 1]],
        [[1, 2], [2, 1]],
        [[1, None], [2, 1], [2, 1]],
        [[2, None], [1, 2]],
        [[1, None], [2, 3], [3, 2]],
    ],
    ids=["none", "own parent", "circle", "twice", "backwards", "circle below"],
)
def test_nodes_that_are_no_tree_are_no_run(tmp_path: Path, nodes: list[list[int | None]]) -> None:
    server, began, *rest = (json.loads(to_line(event)) for event in every_kind())
    node = began["nodes"][0]
    began["nodes"] = [node | {"id": own, "parent": parent} for own, parent in nodes]
    path = raw(tmp_path / "run.mcap", map(json.dumps, [server, began, *rest]))
    assert "holds no run" in whole(path)


def test_a_tree_that_is_too_deep_is_no_run_and_no_path_of_the_others_is_made_without_need(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, began, *rest = (json.loads(to_line(event)) for event in every_kind())
    node, made, path = began["nodes"][0], list[int](), State.path

    def chain(depth: int) -> str:
        own = ({"id": each, "parent": each - 1 or None} for each in range(1, depth + 1))
        began["nodes"] = [node | each | {"name": f"n{each['id']}"} for each in own]
        return whole(raw(tmp_path / "run.mcap", map(json.dumps, [server, began, *rest])))

    monkeypatch.setattr(State, "path", lambda state, of: made.append(of) or path(state, of))
    assert chain(reading.DEEPEST).startswith("all: ")
    assert 0 < len(made) < 100
    assert "holds no run" in chain(reading.DEEPEST + 1)


def test_nodes_and_a_state_that_lie_too_deep_are_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = every_kind()
    added = next(number for number, each in enumerate(events) if isinstance(each, NodesAdded))
    state, texts = state_of(events[: added + 1]), list(map(to_line, events))
    deepest = max(len(state.path(node)) for node in state.nodes)
    for bound in (deepest, deepest - 1):
        monkeypatch.setattr(reading, "DEEPEST", bound)
        from_state = Recording(raw(tmp_path / "a.mcap", texts[added + 1 :], to_json(state)))
        assert any(isinstance(each, State) for each in from_state.items()) == (bound == deepest)
    deeper = replace(events[added], nodes=(Node(4, 3, "New", "wait"), Node(5, 4, "New", "wait")))
    texts[added] = to_line(deeper)
    for bound in (len(state.path(3)) + 2, len(state.path(3)) + 1):
        monkeypatch.setattr(reading, "DEEPEST", bound)
        found = list(Recording(raw(tmp_path / "b.mcap", texts)).items())
        assert (deeper in found) == (bound > len(state.path(3)) + 1)


def test_a_run_of_another_version_is_said_to_be_one(tmp_path: Path) -> None:
    plain = [json.loads(to_line(event)) for event in every_kind()]
    plain[1]["colour"] = "red"
    path = raw(tmp_path / "run.mcap", map(json.dumps, plain))
    size = len(encode(LAYOUTS[EVENTS], (bytes(16), 1, 0, 0, 0, 0), ("Kind", json.dumps(plain[1]))))
    damage = f"1 part of the recording ({size} bytes) is damaged or of another version"
    assert whole(path) == f"{path} holds no run: {damage}"
    del plain[1]["colour"]
    plain[4]["kind"] = "Flew"
    said = whole(raw(path, map(json.dumps, plain)))
    assert said.startswith("all: STOPPED after ")
    assert re.search(r"\n  1 part of the recording .* version; 7 events are missing\n", said)


def test_a_file_that_is_cut_has_a_report_of_what_is_left(tmp_path: Path) -> None:
    first = record(every_kind(rounds=50), tmp_path, killed=0.0)
    data = first.read_bytes()
    for part in range(1, 20):
        first.write_bytes(data[: len(data) * part // 20])
        said = whole(first)
        assert said.startswith("all: never finished\n") or "holds no run" in said
    assert said.startswith("all: never finished\n")


def test_attachments_beyond_a_size_are_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = raw(tmp_path / "run.mcap", map(to_line, every_kind()), name="trees/mine.yaml")
    assert "tree files mine.yaml" in whole(path)
    monkeypatch.setattr(reading, "MOST_BYTES", 10)
    assert "tree files" not in whole(path)
    assert "1 part of the recording (11 bytes) is damaged" in whole(path)


def test_goals_that_never_end_are_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events = every_kind()
    goal = next(each for each in events if isinstance(each, GoalChanged))
    more = [
        replace(goal, at=goal.at._replace(number=9 + number), goal_id=f"{number:032x}")
        for number in range(60)
    ]
    path = raw(tmp_path / "run.mcap", map(to_line, [*events[:3], *more]))
    assert whole(path).startswith("all: never finished")
    monkeypatch.setattr(reading, "MOST_NAMES", 50)
    assert "more names than a run can have" in whole(path)


NASTY = "\x1b[31mred\x9b\u202e\n```\n# head <img src=x> `code`"


def test_names_of_strangers_are_shown_as_text_and_no_more(tmp_path: Path) -> None:
    plain = [json.loads(to_line(event)) for event in every_kind()]
    for node in plain[1]["nodes"]:
        node["name"] = node["place"] = NASTY
    plain[1]["tree"] = plain[1]["caller"] = NASTY
    plain[1]["inputs"] = plain[1]["versions"] = {NASTY: NASTY}
    for each in plain:
        each |= {key: NASTY for key in ("reason", "text", "why", "error") if key in each}
    path = raw(tmp_path / "run.mcap", map(json.dumps, plain), name=f"trees/{NASTY}")
    found = reports(path)
    for line in (*text(found), *markdown(found)):
        assert line.isprintable(), line


def test_no_name_ends_what_markdown_shows_as_text(tmp_path: Path) -> None:
    plain = [json.loads(to_line(event)) for event in every_kind()]
    for node in plain[1]["nodes"]:
        node["name"] = "```\n<img src=x>\n`"
    plain[1]["tree"] = "` <img src=x> `"
    lines = list(markdown(reports(raw(tmp_path / "run.mcap", map(json.dumps, plain)))))
    assert lines[0].startswith("# `' <img src=x> ': STOPPED after ")
    assert [line for line in lines if "```" in line] == ["```text", "```"] * 4


@pytest.mark.parametrize("name", ["trees/../../escaped.yaml", "/tmp/escaped.yaml", "../escaped"])
def test_an_attachment_is_written_nowhere(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    raw(folder / "run.mcap", map(to_line, every_kind()), name=name)
    before = sorted(tmp_path.rglob("*"))
    assert main(["report", "run.mcap", "-o", "x.md"]) == 0
    assert main(["report", "./run.mcap"]) == 0
    assert capsys.readouterr().out.startswith("all: ")
    assert sorted(tmp_path.rglob("*")) == sorted([*before, folder / "x.md"])
    assert not Path("/tmp/escaped.yaml").exists()


@pytest.mark.parametrize("extreme", EXTREMES, ids=range(len(EXTREMES)))
def test_no_summary_makes_more_than_a_line_that_fits(
    tmp_path: Path, extreme: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    first = record(every_kind())
    summary = json.loads(summary_of(first).read_text())
    for key in summary:
        summary_of(first).write_text(json.dumps(summary | {key: extreme}))
        assert main(["runs"]) == 0
        out = capsys.readouterr().out
        assert out.count("\n") == 2
        assert max(map(len, out.splitlines())) <= 200
        assert out.replace("\n", "").isprintable()
        assert main(["runs", "--json"]) == 0
        assert len(json.loads(capsys.readouterr().out)) == 14
    summary_of(first).write_text(json.dumps(extreme))
    assert main(["runs"]) == 0
