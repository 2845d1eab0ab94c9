"""What a browser is told of a run: each event once, in order, and what is not known."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from bt_actions.events import Event, EventsLost, FeedbackCame
from bt_actions.events.wire import from_plain
from bt_actions.page.feed import MOST
from bt_actions.recording import reading, unrecorded
from bt_actions.recording.finishing import finish
from bt_actions.recording.folders import Summary, write_summary
from bt_actions.recording.following import Follower
from bt_actions.recording.reading import Item
from bt_actions.story.state import State
from tests.page.conftest import Begin, Served
from tests.page.test_server import ask
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.recordings import record
from tests.support.stories import state_of
from tests.support.waiting import until


def told_of(rounds: int = 1) -> list[Event]:
    """Events of every kind, in which what was lost has the number of what follows."""
    events = every_kind(rounds)
    for at, each in enumerate(events[:-1]):
        if isinstance(each, EventsLost):
            events[at] = replace(each, at=events[at + 1].at)
    return events


class Told:
    """What comes in the stream of a run."""

    def __init__(self, served: Served, after: str = "", **headers: str) -> None:
        query = f"?after={after}" if after else ""
        self.answer = ask(served, f"/run/{RUN_ID}/events{query}", **headers)
        assert self.answer.status == 200
        self.messages: list[tuple[str, Any]] = []
        self.latest_id = ""

    def read(self, last: str = "end") -> list[Event]:
        """Read up to a message of a kind; return the events of all messages, as far as they are."""
        kind = ""
        while not self.messages or kind != last:
            name, _, value = self.answer.readline().decode().rstrip("\n").partition(": ")
            if name == "id":
                self.latest_id = value
            elif name == "event":
                kind = value
                text = self.answer.readline().decode().removeprefix("data: ")
                self.messages.append((kind, json.loads(text)))
        return self.events

    @property
    def batches(self) -> list[Any]:
        return [data for kind, data in self.messages if kind == "events"]

    @property
    def plain(self) -> list[Any]:
        return [each for batch in self.batches for each in batch["events"]]

    @property
    def events(self) -> list[Event]:
        return [from_plain(each) for each in self.plain if each["kind"] != "StateKnown"]

    @property
    def has_no_gap(self) -> bool:
        ranges = [(each["from"], each["to"]) for each in self.batches]
        return all(begins == ended + 1 for (_, ended), (begins, _) in pairwise(ranges))


def texts(events: list[Event]) -> list[str]:
    return list(map(repr, events))


def test_a_run_that_is_over_is_told_whole_and_its_end(served: Served) -> None:
    events = told_of(rounds=100)
    assert len(events) > 2 * MOST
    record(events)
    told = Told(served)
    assert texts(told.read()) == texts(events)
    assert told.has_no_gap
    kind, end = told.messages[-1]
    assert (kind, end["to"], end["ended"]) == ("end", events[-1].at.number, True)
    assert told.latest_id == f"{RUN_ID}:{events[-1].at.number}"


def test_a_run_whose_process_was_killed_ends_without_an_end(served: Served) -> None:
    events = told_of()[:9]
    record(events, killed=0.5, tick=14.0)
    told = Told(served)
    assert texts(told.read()) == texts(events)
    kind, end = told.messages[-1]
    assert (kind, end["to"], end["ended"], end["unrecorded"]) == ("end", 9, False, "")
    (beat, *_) = [data for kind, data in told.messages if kind == "beat"]
    assert beat["clock"] == pytest.approx(events[-1].at.wall + 0.5)
    assert (beat["tick"], beat["written"]) == (14.0, False)


def test_feedback_that_was_left_out_is_no_gap(served: Served, begin: Begin) -> None:
    events = told_of()
    feedback = next(at for at, each in enumerate(events) if isinstance(each, FeedbackCame))
    run = begin(events)
    run.write(events[:feedback])
    told = Told(served)
    told.read("beat")
    run.write(events[feedback + 1 :])
    told.read("events")
    assert told.has_no_gap
    assert told.batches[-1]["from"] == events[feedback].at.number


@pytest.mark.parametrize("by", ["address", "header"])
@pytest.mark.parametrize("number", [1, 2, 57, 600, 10**6])
def test_a_browser_goes_on_behind_the_last_event_that_it_has(
    served: Served, number: int, by: str
) -> None:
    events = told_of(rounds=100)
    record(events)
    place = f"{RUN_ID}:{number}"
    if by == "header":
        told = Told(served, after=f"{RUN_ID}:3", Last_Event_ID=place)
    else:
        told = Told(served, after=place)
    assert texts(told.read()) == texts([each for each in events if each.at.number > number])
    assert told.has_no_gap
    assert not told.batches or told.batches[0]["from"] == number + 1


@pytest.mark.parametrize("place", [f"{'ab' * 16}:7", "7", f"{RUN_ID}:-1", f"{RUN_ID}:\xb2", "x:y"])
def test_a_browser_whose_place_is_of_no_use_is_told_to_begin_anew(
    served: Served, place: str
) -> None:
    record(told_of())
    told = Told(served, Last_Event_ID=place)
    told.read()
    assert told.messages[0] == ("reset", {})
    assert told.batches[0]["from"] == 1


def test_what_happens_is_told_as_it_comes_through_the_finishing_of_the_files(
    served: Served, begin: Begin
) -> None:
    events = told_of(rounds=30)
    run = begin(events)
    run.write(events[:40])
    told = Told(served)
    assert texts(told.read("beat")) == texts(events[:40])
    for at in range(40, len(events) - 40, 9):
        run.write(events[at : at + 9])
        while len(told.events) < at + 9:
            told.read("events")
        assert texts(told.events) == texts(events[: at + 9])
    run.write(events[len(told.events) :])
    run.end()
    finish(run.first)
    assert texts(told.read()) == texts(events)
    assert told.has_no_gap


def test_a_heartbeat_tells_the_clock_of_the_run_and_how_long_its_tick_lasts(
    served: Served, begin: Begin
) -> None:
    events = told_of()[:9]
    run = begin(events)
    run.write(events)
    told = Told(served)
    told.read("beat")
    assert told.messages[-1][1] == {
        "clock": None,
        "tick": 0.0,
        "written": True,
        "damaged": 0,
        "unrecorded": "",
    }
    at = events[-1].at
    run.writer.beat(at.steady + 14.0, at.wall + 14.0, at.ros, 13.5)
    run.writer.flush()
    told.read("beat")
    beat = told.messages[-1][1]
    assert beat["clock"] == pytest.approx(at.wall + 14.0)
    assert (beat["tick"], beat["written"]) == (13.5, True)


def test_when_a_killed_run_was_last_seen_is_told(served: Served) -> None:
    now = time.time() - 12.0
    events = [replace(each, at=each.at._replace(wall=now)) for each in told_of()[:9]]
    lived = events[-1].at.steady - events[1].at.steady  # on the steady clock, since RunBegan
    record(events, killed=2.0)
    told = Told(served)
    told.read()
    assert told.messages[-1][1]["ago"] == pytest.approx(12.0 - lived - 2.0, abs=2.0)


def test_a_run_that_is_not_recorded_any_further_is_told_so_while_it_goes_on_and_afterwards(
    served: Served, begin: Begin
) -> None:
    events = told_of()[:9]
    run = begin(events)
    run.write(events)
    summary = Summary(RUN_ID, "all", 1.8e9)
    with unrecorded.told(summary, 1.8e9, "the disk is full"):
        told = Told(served)
        told.read("beat")
        since = unrecorded.since_text(1.8e9, "the disk is full")
        assert told.messages[-1][1]["unrecorded"] == since
    write_summary(run.first, replace(summary, status="SUCCESS", unrecorded=since))
    run.end()
    told.read()
    _, end = told.messages[-1]
    assert (end["ended"], end["unrecorded"], end["outcome"]) == (False, since, "SUCCESS")


def test_where_files_are_missing_all_that_is_known_of_the_state_is_told(
    served: Served, begin: Begin
) -> None:
    events = told_of(rounds=60)
    run = begin(events, size=20_000, files=3)
    for event in events:
        run.write([event])
    run.end()
    told, found = Told(served), State()
    told.read()
    for each in told.plain:
        if each["kind"] == "StateKnown":
            found = state_of(map(from_plain, each["events"]))
            found.now = from_plain({**each["events"][0], "at": each["at"]}).at
        else:
            found.fold(from_plain(each))
    assert told.has_no_gap
    assert [each["kind"] for each in told.plain].count("StateKnown") == 1
    expected = state_of(events)
    for name in ("variables", "servers", "finished", "ended", "stop"):
        assert getattr(found, name) == getattr(expected, name)
    for key, story in expected.nodes.items():
        assert (found.nodes[key].status, found.nodes[key].round) == (story.status, story.round)
    goals = {key: goal.latest.end for each in expected.actions for key, goal in each.goals.items()}
    assert goals == {
        key: goal.latest.end for each in found.actions for key, goal in each.goals.items()
    }


def test_a_browser_that_stops_reading_has_no_more_read_for_it(
    served: Served, begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = told_of(rounds=2500)
    begin(events).write(events)
    read, news = [0], Follower.news

    def counted(self: Follower) -> Iterator[Item]:
        for item in news(self):
            read[0] += 1
            yield item

    monkeypatch.setattr(Follower, "news", counted)
    with socket.socket() as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        silent.connect(("127.0.0.1", served.port))
        head = f"Host: localhost:{served.port}\r\nCookie: {served.cookie}\r\n\r\n"
        silent.sendall(f"GET /run/{RUN_ID}/events HTTP/1.1\r\n{head}".encode())
        until(lambda: read[0])
        reader = Told(served)
        reader.read("beat")  # somebody else is told all of it meanwhile
        assert len(reader.events) == len(events)
        assert read[0] < len(events) + 10 * MOST < 1.5 * len(events)


def test_a_browser_that_stops_reading_does_not_keep_the_server_from_its_end(
    served: Served, begin: Begin
) -> None:
    events = told_of(rounds=2500)
    begin(events).write(events)
    with socket.socket() as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        silent.connect(("127.0.0.1", served.port))
        head = f"Host: localhost:{served.port}\r\nCookie: {served.cookie}\r\n\r\n"
        silent.sendall(f"GET /run/{RUN_ID}/events HTTP/1.1\r\n{head}".encode())
        assert silent.recv(100)
        Told(served).read("beat")  # by then there is no more room for what it does not read
        served.stop()


def test_a_file_that_is_no_recording_is_said_to_be_none(served: Served) -> None:
    record(told_of()).write_bytes(b"no mcap, by far")
    told = Told(served)
    assert told.read("broken") == []
    assert "no MCAP file" in told.messages[-1][1]["why"]


def test_a_recording_that_cannot_be_read_is_told_of_in_words(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(told_of())
    monkeypatch.setattr(reading, "MOST_NAMES", 0)
    told = Told(served)
    told.read("broken")
    assert "more names than a run can have" in told.messages[-1][1]["why"]
