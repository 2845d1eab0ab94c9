"""Views and runs that are killed at random: what is shown has no gap, and replay shows the same."""

from __future__ import annotations

import contextlib
import http.client
import json
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from bt_actions.events import AttemptEnded, FeedbackCame, GoalChanged, RoundBegan
from bt_actions.page import feed
from bt_actions.page.standing import token
from bt_actions.recording.folders import home, read_summary, recorded
from bt_actions.recording.reading import Recording
from tests.page.conftest import Begin, Served
from tests.page.test_feed import Told, told_of
from tests.support import browser as chromium
from tests.support.every_kind import RUN_ID
from tests.support.waiting import until

KILLS = 50
ROOT = Path(__file__).parents[2]
SERVE = """
import sys
from bt_actions.page import server
opened = server.listen(int(sys.argv[1]) or None)
print(opened.getsockname()[1], flush=True)
server.server_of().run(sockets=[opened])
"""


class Killed:
    """A view in a process of its own, which can be killed and comes back on its port."""

    def __init__(self) -> None:
        self.port = 0
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", SERVE, str(self.port)], stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.port = int(self.process.stdout.readline())

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.mark.slow
@pytest.mark.timeout(400)  # fifty kills
def test_a_view_that_is_killed_at_any_moment_leaves_no_gap(begin: Begin) -> None:
    dice, events = random.Random(7), told_of(rounds=150)
    run, view, cookie = begin(events), Killed(), token()
    known: list[dict[str, Any]] = []
    written = 0
    try:
        for _ in range(KILLS):
            number = known[-1]["to"] if known else 0
            connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=20.0)
            place = f"/run/{RUN_ID}/events?after={RUN_ID}:{number}"
            connection.request("GET", place, headers={"Cookie": f"bt_actions_{view.port}={cookie}"})
            answer = connection.getresponse()
            ends = time.monotonic() + dice.random() * 0.3
            with contextlib.suppress(OSError, http.client.HTTPException):
                while time.monotonic() < ends and (line := answer.readline()):
                    some = events[written : written + dice.randrange(12)]
                    written += len(some)
                    run.write(some)
                    if line.startswith(b'data: {"from"'):
                        known.append(json.loads(line[6:]))
            view.kill()
            view.start()
        run.write(events[written:])
        run.end()
        told = []
        connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=20.0)
        place = f"/run/{RUN_ID}/events?after={RUN_ID}:{known[-1]['to']}"
        connection.request("GET", place, headers={"Cookie": f"bt_actions_{view.port}={cookie}"})
        for line in connection.getresponse():
            told.append(line)
            if line.startswith(b'data: {"from"'):
                known.append(json.loads(line[6:]))
        assert any(line == b"event: end\n" for line in told)
    finally:
        view.kill()
    ranges = [(each["from"], each["to"]) for each in known]
    assert all(after == before + 1 for (_, before), (after, _) in pairwise(ranges))
    numbers = [event["at"][0] for each in known for event in each["events"]]
    assert numbers == [each.at.number for each in events]


@pytest.mark.slow
@pytest.mark.timeout(400)  # fifty kills
def test_a_run_that_is_killed_at_any_moment_is_told_whole_and_as_lost(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    dice = random.Random(3)
    monkeypatch.setattr(feed, "BEAT", 0.1)  # so that the end is seen soon
    for _ in range(KILLS):
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.support.recorded_process", str(home()), "200"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(40 + dice.randrange(60))]
        until(lambda: [each for each in recorded() if read_summary(each.first)])
        told = Told(served)
        time.sleep(dice.random() * 0.2)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed = time.time()
        told.read()
        assert len(lines) >= 40
        kind, end = told.messages[-1]
        assert (kind, end["ended"], end["unrecorded"]) == ("end", False, "")
        assert 0.0 <= end["ago"] <= time.time() - killed + 1.5
        assert told.has_no_gap
        values = [each["value"] for each in told.plain if each["kind"] == "VariableWritten"]
        assert values == list(range(1, len(values) + 1))
        (one,) = recorded()
        assert Recording(one.first).state().variables["x"].value == values[-1]
        for each in one.first.parent.iterdir():
            each.unlink()
        one.first.parent.rmdir()


SHOWN = """
window.shown = (run, count) => {
  const s = run.go(count), { t } = run.events[count - 1];
  const phases = (a) => a.phases.filter((one) => one.from <= t).map((one) => [one.st, one.from]);
  return JSON.stringify([
    [...s.status].slice(0, 3), [...s.message].slice(0, 3), [...s.from].slice(0, 3), [...s.running], [...s.vars].map(([name, e]) => [name, e.value]),
    [...s.round].map(([n, e]) => [n, e.number]), [...s.due], [...s.up], s.dealt.map((one) => [one.n, one.number, one.by]),
    [...s.pending].map(([n, all]) => [n, all.map((one) => one.number)]), s.finished?.status, s.stop?.why, s.lasting?.n, s.paused, s.lost,
    run.attempts.filter((a) => a.start <= t).map((a) => [a.id, phases(a), words.story(a, run.nodes[a.n], t)]),
  ]);
};
return import("/words.js").then((words) => { window.words = words; });
"""  # noqa: E501
"""What the store of a page says behind so many events, of the nodes that are there all along."""


@pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")
def test_replay_shows_what_live_showed_at_200_events(
    window: chromium.Browser, served: Served, begin: Begin
) -> None:
    dice, events = random.Random(5), told_of(rounds=40)
    rounds = 0
    for at, each in enumerate(events):  # each goal with an id of its own
        rounds += isinstance(each, RoundBegan)
        if isinstance(each, GoalChanged | AttemptEnded | FeedbackCame):
            events[at] = replace(each, goal_id=f"{rounds:032x}")
    run = begin(events)
    run.write(events[:8])
    window.open(served.address)
    assert window.wait_for("window.page?.shown")
    window.run(SHOWN)
    window.run(
        "window.live = {}; const take = page.run.take;"
        "const to = (e, run) => (e.kind === 'EventsLost' ? run.number : e.at[0]);"
        "page.run.take = function (batch) {"
        "  const all = batch.events;"
        "  for (const e of all) {"
        "    const one = { from: batch.from, to: to(e, this), events: [e] };"
        "    if (!take.call(this, one)) return false;"
        "    live[this.events.length] = shown(this, this.events.length);"
        "  }"
        "  return take.call(this, { ...batch, events: [] });"
        "};"
    )
    at = 8
    while at < len(events):
        some = events[at : at + dice.randrange(1, 20)]
        at += len(some)
        run.write(some)
        assert window.wait_for("page.run.events.length === arguments[0]", at)
    live = window.run("return live")
    run.end()
    window.open(served.address)
    assert window.wait_for("window.page?.shown && page.run.over")
    window.run(SHOWN)
    counts = dice.sample(sorted(map(int, live)), 200)
    replayed = window.run("return arguments[0].map((count) => shown(page.run, count))", counts)
    for count, one in zip(counts, replayed, strict=True):
        assert json.loads(live[str(count)]) == json.loads(one), f"behind {count} events"


def test_a_hundred_tabs_are_answered_or_told_to_come_again(served: Served, begin: Begin) -> None:
    events = told_of()
    begin(events).write(events)
    tabs = []
    for _ in range(100):
        connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=20.0)
        connection.request("GET", f"/run/{RUN_ID}/events", headers={"Cookie": served.cookie})
        tabs.append((connection, connection.getresponse()))
    statuses = [answer.status for _, answer in tabs]
    assert set(statuses) == {200, 503}
    assert statuses.count(200) >= 60
    told = [answer for _, answer in tabs if answer.status == 200]
    for answer in told:
        while not answer.readline().startswith(b'data: {"from"'):
            continue
    for connection, answer in tabs:
        answer.close()
        connection.close()
    until(lambda: Told(served).read("beat"))


@pytest.mark.parametrize("seed", range(20))
def test_a_hostile_recording_is_told_as_far_as_it_goes_and_never_with_a_gap(
    served: Served, begin: Begin, seed: int
) -> None:
    dice, events = random.Random(seed), told_of(rounds=20)
    run = begin(events)
    run.write(events)
    run.end()
    data = bytearray(run.first.read_bytes())
    for _ in range(dice.randrange(1, 30)):
        at = dice.randrange(8, len(data))
        if dice.random() < 0.5:
            data[at] = dice.randrange(256)
        else:
            data[at : at + dice.randrange(200)] = dice.randbytes(dice.randrange(200))
    run.first.write_bytes(data)
    told = Told(served)
    told.read("end" if data.startswith(b"\x89MCAP") else "broken")
    assert told.has_no_gap
    numbers = [each["at"][0] for each in told.plain]
    assert numbers == sorted(numbers)
