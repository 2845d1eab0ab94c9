"""The page as a reader has it, in Chromium: a real run that failed, and runs that go on.

Skipped where there is no Chromium.
"""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from bt_actions.events import Moment, RunBegan, TickLasts
from bt_actions.recording import unrecorded
from bt_actions.recording.folders import Summary, write_summary
from tests.page.conftest import SHIFTS, SHOWN, Beating, Begin, Page, Served
from tests.page.test_feed import told_of
from tests.support import browser as chromium
from tests.support.every_kind import RUN_ID
from tests.support.recordings import record

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")
WHY = "document.getElementById('why').innerText"
ROWS = "[...document.querySelectorAll('.row:not([hidden])')].map((one) => one.innerText)"


# A run that is over


@pytest.mark.ros
def test_a_run_that_failed_says_why_first_with_the_line_of_the_file(over: Page) -> None:
    window = over.open()
    strip = " ".join(window.run(f"return {WHY}").split())
    assert strip.startswith("Why exit code 1 Home: ABORTED aborted by /move_robot;")
    assert "examples/night/night.yaml :90" in strip
    said = window.run("return document.getElementById('said').textContent")  # to a screen reader
    assert said.startswith("Home: ABORTED. At 00:")
    for passed_on in ("Home in time", "Straight home", "Go home", "Shift"):
        assert passed_on in strip
    assert over.text("#status", "Failed") == "Failed"
    assert over.text("#conn", "Replay") == "Replay"
    assert over.text("#tree-where", "simulated").startswith("simulated")
    assert over.text("#details h2", "Home").split() == ["Home", "Failed"]
    assert "fault: abort" in over.text("#details", "Result")
    assert "once: Home" in over.text(".yaml .at", "Home")


@pytest.mark.ros
def test_the_outline_has_the_nodes_with_state_and_try(over: Page) -> None:
    window = over.open()
    window.run("document.querySelector('#tree-scroll').scrollTop = 0")
    window.wait_for(f"{ROWS}.some((row) => row.startsWith('Grasp'))")
    rows = {row.split("\n")[0]: row.split("\n") for row in window.run(f"return {ROWS}")}
    assert rows["Grasp"] == ["Grasp", "Gripper", "UNEXPECTED_RESULT", *rows["Grasp"][3:]]
    assert rows["Grasp"][-2:] == ["3/3", "/gripper_control"]
    assert rows["Open"][2] == "Succeeded"
    assert len(rows) < 60


@pytest.mark.ros
def test_an_earlier_failure_says_what_was_expected_and_who_went_on(over: Page) -> None:
    window = over.open()
    window.run("document.querySelector('#why [aria-label=\"Next failure\"]').click()")
    strip = " ".join(over.text("#why", "2 of 3").split())
    assert "Each station 3 of 3 › Grasp: UNEXPECTED_RESULT" in strip
    assert "result.stalled is false; expected result.stalled" in strip
    assert "Hold the part went on" in strip


@pytest.mark.ros
def test_a_leap_to_a_failure_shows_that_moment_everywhere(over: Page) -> None:
    window = over.open()
    window.run("page.seek(0)")
    over.text("#why", "Not begun")
    window.keys("n")
    assert "UNEXPECTED_RESULT" in over.text("#details", "Attempt 1 of 3")
    t = window.run("return page.t")
    assert 0 < t < window.run("return page.head")
    assert over.text("#status", "Running") == "Running"
    assert over.text("#row-18", "To the shelf").split("\n")[2] == "Succeeded before"  # last round
    window.wait_for("location.hash.includes(`t=${page.t.toFixed(3)}`)")
    address = window.run("return location.hash")
    window = over.open(address)  # as it was, when the page is loaded again
    assert window.run("return page.t") == pytest.approx(t, abs=0.001)
    assert over.text("#details h2", "Grasp")
    window.keys("l")
    assert over.text("#status", "Failed") == "Failed"


@pytest.mark.ros
def test_every_pane_shows_the_run(over: Page) -> None:
    window = over.open()
    window.keys("v")
    assert "Each station" in over.text("#values", "stations")
    window.keys("o")
    over.text("#log", "exit code 1")
    window.run("document.querySelector('#log-scroll').scrollTop = 0")
    assert "Station 0" in over.text("#log", "Station 0")
    window.keys("t")
    assert window.wait_for("document.querySelectorAll('#shapes .node.failure').length === 7")
    servers = window.run(
        "return [...document.querySelectorAll('.lane .label')].map((one) => one.innerText)"
    )
    assert servers[2:] == ["/gripper_control", "/move_robot"]
    assert window.run("return document.querySelectorAll('.bar').length") > 10


@pytest.mark.ros
@pytest.mark.parametrize("width", [390, 1024, 1920])
def test_nothing_is_wider_than_the_window(over: Page, width: int) -> None:
    window = over.open(width=width)
    assert window.run("return document.documentElement.scrollWidth") <= width


@pytest.mark.ros
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_can_be_read_in_light_and_dark(over: Page, scheme: chromium.Scheme) -> None:
    over.window.page.emulate_media(color_scheme=scheme)
    for pane in ("tab=details", "tab=values", "tab=log&t=2.0", "view=graph"):
        assert over.open(f"#{pane}").run(CONTRAST) == []


CONTRAST = """
const pen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
const rgba = (colour) => {
  pen.clearRect(0, 0, 1, 1); pen.fillStyle = colour; pen.fillRect(0, 0, 1, 1);
  return [...pen.getImageData(0, 0, 1, 1).data];
};
const light = ([r, g, b]) => [r, g, b].map((one) => one / 255)
  .map((one) => (one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4))
  .reduce((sum, one, at) => sum + one * [0.2126, 0.7152, 0.0722][at], 0);
const over = (top, under) => top.slice(0, 3)
  .map((one, at) => one * top[3] / 255 + under[at] * (1 - top[3] / 255));
const ground = (element) => {
  const layers = [];
  for (; element; element = element.parentElement) {
    layers.unshift(rgba(getComputedStyle(element).backgroundColor));
  }
  return layers.reduce((under, top) => over(top, under), [255, 255, 255]);
};
return [...document.body.querySelectorAll("*")]
  .filter((one) => one.checkVisibility() && !one.closest("svg, noscript, .off-screen, :disabled"))
  .filter((one) => [...one.childNodes].some((child) => child.data?.trim()))
  .filter((one) => {
    const back = ground(one), front = over(rgba(getComputedStyle(one).color), back);
    const [dark, bright] = [light(front), light(back)].sort((a, b) => a - b);
    return (bright + 0.05) / (dark + 0.05) < 4.5;
  })
  .map((one) => `${one.className}: ${one.textContent}`);
"""
"""The texts that are seen whose contrast with what is behind them is too little, by WCAG 2."""


# Runs that go on


def test_what_happens_appears_and_the_page_follows(page: Page, begin: Begin) -> None:
    events = told_of()
    run = begin(events)
    run.write(events[:6])
    beating = Beating(run, events[:6])
    try:
        window = page.open()
        assert page.text("#conn", "Live") == "Live"
        assert "Move" in page.text("#why", "Now")
        assert "Following live" in page.text("#go-live", "Following live")
        window.run(SHIFTS)
        beating.write(events[6:9])
        beating.write(events[9:12])
        page.text("#why", "1 failure")
        window.run("window.row = document.querySelector('.row[aria-selected=true]'); row.focus()")
        left = events[12:]
        for each in left:
            beating.write([each])
        page.text("#status", "Stopped")
        assert window.run("return document.activeElement === row && row.isConnected")
        assert window.run("return page.run.events.length") == len(events)
        assert window.run("return window.shifts") < 0.001
    finally:
        beating.stop()
    run.end()
    assert page.text("#conn", "Replay") == "Replay"
    assert window.wait_for("page.t === page.run.clock")  # as when it is opened again
    assert "interrupted by SIGINT" in page.text("#why", "Stopped")


def test_on_a_phone_the_tools_of_the_timeline_are_seen_whole(page: Page, begin: Begin) -> None:
    run = begin(events := told_of()[:8])
    run.write(events)
    window = page.open("#pane=time", width=390)
    page.text("#go-live", "Following live")
    button = "document.getElementById('go-live')"
    wide = f"const words = document.createRange(); words.selectNodeContents({button});"
    wide += f"return {button}.clientWidth - words.getBoundingClientRect().width"
    assert window.run(wide) >= 8
    parts = "[...document.querySelectorAll('.legend > span')]"
    rights = window.run(f"return {parts}.map((one) => one.getBoundingClientRect().right)")
    assert len(rights) == 6
    assert max(rights) <= 390


def test_a_tick_that_lasts_is_told_with_its_leaf(page: Page, begin: Begin) -> None:
    events = told_of()[:7]
    at = events[-1].at
    lasts = Moment(at.number + 1, at.steady + 1.5, at.wall + 1.5, at.ros)
    events.append(TickLasts(lasts, 2, 1.2))
    run = begin(events)
    run.write(events)
    beating = Beating(run, events)
    try:
        page.open()
        page.text("#why", "in its tick for ")
        for seconds in (2.0, 3.0):
            lasts = "/in its tick for ([\\d.]+)/.exec(document.querySelector('#why').innerText)"
            page.window.wait_for(f"{lasts}?.[1] >= arguments[0]", seconds)
        assert page.text("#conn", "Live") == "Live"
        assert "In its tick" in page.text("#tree-rows", "In its tick")
    finally:
        beating.stop()


def test_a_run_without_a_heartbeat_is_stale_and_its_clock_stands(page: Page, begin: Begin) -> None:
    events = told_of()[:7]
    run = begin(events)
    run.write(events)
    beating = Beating(run, events)
    page.open()
    assert page.text("#conn", "Live") == "Live"
    beating.stop()
    assert "Stale for" in page.text("#conn", "Stale")
    stood = page.window.run("return page.t")
    page.window.wait_for(
        "/Stale for (\\d+)/.exec(document.querySelector('#conn').innerText)?.[1] >= 4"
    )
    assert page.window.run("return page.t") == stood
    assert page.text("#why", "Last seen")
    run.end()  # and no end of the run is told: its process is gone
    assert page.text("#conn", "Lost for")
    assert page.text("#status", "Never finished") == "Never finished"
    assert "was killed" in page.text("#banner", "The recording ends")
    assert page.window.run("return page.t") == stood
    assert "Last seen" in page.text("#why", "Last seen")


def test_a_run_that_was_killed_is_lost_for_as_long_as_that_is_ago(page: Page) -> None:
    now = time.time() - 100.0
    record([replace(each, at=each.at._replace(wall=now)) for each in told_of()[:9]], killed=0.5)
    page.open()
    assert page.text("#conn", "Lost for").startswith("Lost for")
    lived = 7 / 8 + 0.5
    silence = page.window.run("return page.link.silence")
    assert silence == pytest.approx(time.time() - now - lived, abs=3.0)
    ends = "(page.run.info.wall + page.run.clock) * 1000"
    when = page.window.run(f"return new Date({ends}).toLocaleString()")
    assert f"The recording ends at 00:00.8, {when}" in page.text("#banner", "The recording ends")
    assert page.text("#conn", "Lost for 101 s")


def test_a_run_that_is_recorded_no_further_is_never_live(page: Page, begin: Begin) -> None:
    events = told_of()[:7]
    run = begin(events)
    run.write(events)
    beating = Beating(run, events)
    summary = Summary(RUN_ID, "all", 1.8e9)
    with unrecorded.told(summary, 1.8e9, "the disk is full"):
        beating.stop()
        page.open()
        assert page.text("#conn", "Not recorded") == "Not recorded"
        assert page.text("#status", "Not recorded") == "Not recorded"
        said = page.text("#banner", "Not recorded since")
        assert f"{unrecorded.since_text(1.8e9, 'the disk is full')}. As of 00:0" in said
        assert "Last seen" in page.text("#why", "Last seen")
    write_summary(run.first, replace(summary, status="SUCCESS", unrecorded="12:03:10: full"))
    run.end()
    assert "The run ended later: SUCCESS" in page.text("#banner", "The run ended later")
    assert page.text("#conn", "Replay") == "Replay"


def test_a_lost_server_comes_back_without_a_gap(page: Page, begin: Begin, served: Served) -> None:
    events = told_of(rounds=3)
    run = begin(events)
    run.write(events[:10])
    beating = Beating(run, events[:10])
    try:
        window = page.open()
        page.text("#conn", "Live")
        window.run("page.seek(0.4)")
        served.stop()
        assert "Lost for" in page.text("#conn", "Lost")
        assert "next try in" in page.text("#banner", "next try in")
        beating.write(events[10:25])
        served.start()
        assert page.text("#conn", "Live") == "Live"
        beating.write(events[25:])
        assert window.wait_for("page.run.events.length === arguments[0]", len(events))
        numbers = window.run("return page.run.events.map((each) => each.at[0])")
        assert numbers == [each.at.number for each in events]
        assert window.run("return page.run.lines.some((line) => line.x.startsWith('7 events'))")
        assert window.run("return page.t") == pytest.approx(0.4)  # the reader's time stays
    finally:
        beating.stop()


def test_what_is_not_recorded_is_said(page: Page, begin: Begin) -> None:
    events = told_of(rounds=60)
    run = begin(events, size=20_000, files=3)
    for each in events:
        run.write([each])
    run.end()
    window = page.open()
    assert page.text("#status", "Stopped") == "Stopped"
    (gap,) = window.run("return page.run.missing")
    window.run("page.seek(arguments[0])", (gap["from"] + gap["to"]) / 2)
    assert page.text("#status", "Not recorded") == "Not recorded"
    assert page.text("#why", "Nothing is recorded from")
    window.run("page.seek(arguments[0])", gap["from"] - 0.5)
    assert page.text("#status", "Running") == "Running"
    assert window.run("return document.querySelectorAll('#lanes .missing').length") == 1


def test_a_recording_that_is_damaged_is_said_to_be(page: Page) -> None:
    first = record(told_of(), killed=0.5)
    first.write_bytes(first.read_bytes().replace(b'"kind":"Logged"', b'"kind":"Bogged"'))
    page.open()
    assert "1 of its records is damaged" in page.text("#banner", "damaged")


def test_a_page_that_has_taken_much_begins_anew_where_it_is(page: Page, begin: Begin) -> None:
    events = told_of(rounds=9)
    run = begin(events)
    run.write(events[:10])
    window = page.open()
    window.run("page.more = 50; window.old = page.run; page.go_tab('log'); page.seek(0.4)")
    for each in events[10:]:
        run.write([each])
    assert window.wait_for("page.run !== old && page.shown")
    assert window.wait_for("page.run.events.length === arguments[0]", len(events))
    assert window.run("return [page.t, page.tab, page.at_head]") == [0.4, "log", False]


def test_a_page_without_a_run_shows_the_first_that_begins(page: Page) -> None:
    page.window.open(page.place)
    page.text("#other", "No run yet")
    record(told_of())
    assert page.window.wait_for(SHOWN)
    assert page.text("#tree-name", "all") == "all"


def test_another_run_is_a_choice_away(page: Page) -> None:
    record(told_of())
    page.open()
    page.window.run("document.getElementById('switch').click()")
    assert RUN_ID[:8] in page.text("#runs", RUN_ID[:8])
    page.window.run("document.querySelector('#runs .opt').click()")
    assert page.window.wait_for(SHOWN)


def test_names_that_hold_markup_are_text(page: Page) -> None:
    nasty = "<img src=x onerror=window.pwned=1>"
    events = told_of()
    for number, each in enumerate(events):
        if isinstance(each, RunBegan):
            nodes = tuple(replace(node, name=nasty, kind=nasty) for node in each.nodes)
            events[number] = replace(each, nodes=nodes, tree=nasty)
    record(events)
    window = page.open()
    for key in "vot":
        window.keys(key)
    assert page.text("#tree-name", nasty) == nasty
    assert window.run("return window.pwned ?? null") is None
    assert window.run("return document.querySelectorAll('img').length") == 0
