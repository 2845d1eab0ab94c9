"""What the panes of the page do while a run goes on: nothing jumps, and nothing is made anew."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions.events import (
    Event,
    FeedbackCame,
    GoalChanged,
    Logged,
    Moment,
    Node,
    NodeChanged,
    RunBegan,
    VariableWritten,
)
from bt_actions.goals.policy import End, Outcome
from tests.page.conftest import SHIFTS, Beating, Begin, Page, Served
from tests.support import browser as chromium

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")
SERVER = "/arm/move"
TO = {"to": 1.0}
LIMITS = {"result": 60.0, "feedback": None, "accept": 5.0}
TREE = (
    Node(1, None, "Work", "sequence"),
    Node(2, 1, "Reach", "action", "w.yaml:4:3", SERVER, "Move", {"timeouts": LIMITS}),
    Node(3, 1, "Say", "log", "w.yaml:9:3"),
    *(Node(number, 1, f"Later {number}", "success") for number in range(4, 90)),
)
BARS = "[...document.querySelectorAll('.bar')].map((one) => one.getBoundingClientRect().left)"

HEARD = """
window.heard = [];
for (const one of document.querySelectorAll("[role=status], [role=alert], [aria-live=polite]")) {
  new MutationObserver(() => heard.push(one.textContent))
    .observe(one, { childList: true, characterData: true, subtree: true });
}
"""
"""Notes what changes in the places of which a screen reader tells."""
SEEN = """
window.seen = new Set();
const banner = document.querySelector("#banner");
new MutationObserver(() => {
  if (banner.textContent.includes("next try in")) seen.add(banner.textContent);
}).observe(banner, { childList: true, characterData: true, subtree: true });
"""
"""Notes the words of a countdown."""


class Story:
    """Events, each at its time in seconds since the run began."""

    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self.told: list[Event] = []
        self.add(0.0, RunBegan, "a" * 32, "work", TREE, {}, {"w.yaml": "tree: work\n" * 9}, {})
        self.add(0.0, NodeChanged, 1, Status.RUNNING, "")

    def add(self, t: float, kind: type[Event], *of: Any) -> None:
        self.told.append(kind(Moment(next(self._numbers), 100.0 + t, 1e9 + t, 0.0), *of))

    def begin(self, t: float, goal: str, message: Any = TO) -> None:
        """The leaf's goal is sent, and executes."""
        self.add(t, NodeChanged, 2, Status.RUNNING, "")
        self._goal(t, goal, "SENDING", None, None, message)
        self._goal(t + 0.1, goal, "EXECUTING", None, None)

    def end(self, t: float, goal: str, result: Any = None) -> None:
        self._goal(t, goal, "DONE", Outcome.SUCCEEDED, End.SUCCEEDED, None, result)
        self.add(t, NodeChanged, 2, Status.SUCCESS, "")

    def _goal(self, t: float, goal: str, state: str, outcome: Any, end: Any, *of: Any) -> None:
        self.add(t, GoalChanged, 2, goal, 1, state, outcome, end, "", SERVER, *of)

    def new(self) -> list[Event]:
        """What was told since the last call."""
        told, self.told = self.told, []
        return told


def place(window: chromium.Browser, element: str) -> dict[str, float]:
    box = window.run(f"return {element}.getBoundingClientRect().toJSON()")
    assert isinstance(box, dict)
    return box


@pytest.fixture
def story() -> Story:
    story = Story()
    for number, t in enumerate((0.5, 2.0, 4.0)):
        story.begin(t, f"{number}" * 32)
        story.end(t + 1.0, f"{number}" * 32)
    return story


def test_a_press_and_a_drag_on_the_timeline_set_the_time(
    page: Page, begin: Begin, story: Story
) -> None:
    run = begin(events := story.new())
    run.write(events)
    window = page.open()
    ruler = place(window, "document.getElementById('ruler')")
    y = ruler["y"] + ruler["height"] / 2
    (first, second, _) = window.run(f"return {BARS}")
    window.page.mouse.click(first, y)
    assert window.wait_for("Math.abs(page.t - 0.5) < 0.05")
    window.page.mouse.down()
    window.page.mouse.move(second, y)
    window.page.mouse.up()
    assert window.wait_for("Math.abs(page.t - 2.0) < 0.05")
    assert window.run("return page.at_head") is False


def test_bars_stand_where_their_times_are(page: Page, begin: Begin, story: Story) -> None:
    run = begin(events := story.new())
    run.write(events)
    one, two, three = page.open().run(f"return {BARS}")
    assert (two - one) / (three - one) == pytest.approx((2.0 - 0.5) / (4.0 - 0.5), abs=0.01)


def test_no_bar_jumps_while_a_gap_grows_and_when_it_closes(
    page: Page, begin: Begin, story: Story
) -> None:
    run = begin(events := story.new())
    run.write(events)
    window = page.open()
    before = window.run(f"return {BARS}")
    for number, t in enumerate((9.0, 12.0, 40.0)):
        story.add(t, Logged, 3, "info", f"still here {number}")
        run.write(story.new())
        assert window.wait_for(f"page.head >= {t}")
        assert window.wait_for("page.s.t === page.t")
        assert window.run(f"return {BARS}") == before
    story.begin(41.0, "9" * 32)
    story.end(42.0, "9" * 32)
    run.write(story.new())
    assert window.wait_for(f"{BARS}.length === 4")
    assert window.run(f"return {BARS}")[:3] == before
    assert window.run("return document.querySelector('.leap').innerText") == "32.0 s"


def test_details_and_variables_are_kept_through_what_comes(
    page: Page, begin: Begin, story: Story
) -> None:
    story.begin(6.0, "7" * 32)
    story.add(6.2, VariableWritten, "part", 1.0, 2)
    run = begin(events := story.new())
    run.write(events)
    window = page.open("#node=2")
    for number in range(20):
        story.add(6.2 + number / 10, FeedbackCame, 2, "7" * 32, {"pose": number / 10})
        run.write(story.new())
        if not number:
            page.text("#details", "pose 0")
            window.run("window.kept = [...document.querySelectorAll('#details *, .var, .row')]")
            window.run("window.line = document.querySelector('.spark .l').getAttribute('d')")
            page.window.keys("v")
    story.add(8.3, VariableWritten, "part", 2.0, 2)
    run.write(story.new())
    page.text("#values", "2 writes")
    page.window.keys("d")
    page.text("#details", "pose 1.9")
    made = "'.hist, .by, .st, .ph'"  # which show another value, glyph or length then
    kept = f"window.kept.filter((one) => !one.isConnected && !one.closest({made}))"
    assert window.run(f"return {kept}.length") == 0
    assert window.run("return document.querySelector('.spark .l').getAttribute('d') !== line")


def test_a_log_that_is_scrolled_up_stays_and_counts_what_is_new(
    page: Page, begin: Begin, story: Story
) -> None:
    for number in range(90):
        story.add(6.0 + number / 50, Logged, 3, "info", f"line {number}")
    run = begin(events := story.new())
    run.write(events)
    window = page.open("#tab=log")
    page.text("#log", "line 89")
    window.run("document.getElementById('log-scroll').scrollTop = 240")
    assert window.wait_for("document.querySelector('#log-rows').innerText.includes('line 4')")
    window.run("window.first = document.querySelector('.line:not([hidden])')")
    for number in range(12):
        story.add(9.0 + number / 50, Logged, 3, "info", f"more {number}")
    run.write(story.new())
    assert page.text("#log .more", "new") == "12 new ↓"
    assert window.run("return document.getElementById('log-scroll').scrollTop") == 240
    assert window.run("return window.first.isConnected")
    window.run("document.querySelector('#log .more').click()")
    page.text("#log", "more 11")


def test_the_row_that_has_the_focus_keeps_it_while_events_come(
    page: Page, begin: Begin, story: Story
) -> None:
    run = begin(events := story.new())
    run.write(events)
    window = page.open("#node=2")
    window.run("window.row = document.querySelector('.row[aria-selected=true]'); row.focus()")
    for number in range(4, 44):
        story.add(6.0 + number / 20, NodeChanged, number, Status.RUNNING, "")
        story.add(6.0 + number / 20, NodeChanged, number, Status.SUCCESS, "")
        run.write(story.new())
    assert window.wait_for("page.run.events.length > 90")
    assert window.run("return document.activeElement === window.row")
    assert window.run("return document.querySelectorAll('.row').length") < 60


def test_nothing_shifts_live_nor_through_loss_of_the_server(
    page: Page, begin: Begin, story: Story, served: Served
) -> None:
    run = begin(events := story.new())
    run.write(events)
    beating = Beating(run, events)
    try:
        window = page.open()
        page.text("#conn", "Live")
        window.run(SHIFTS)
        story.begin(7.0, "5" * 32)
        beating.write(story.new())
        page.text("#why", "Reach")
        served.stop()
        page.text("#banner", "next try in")
        served.start()
        page.text("#conn", "Live")
        story.end(9.0, "5" * 32)
        beating.write(story.new())
        page.text("#why", "Work")
        assert window.run("return window.shifts") == 0
    finally:
        beating.stop()


@pytest.mark.parametrize(
    ("goal", "words"), [("•••", "hidden: it may hold a secret"), (None, "not recorded")]
)
def test_the_details_say_why_no_goal_is_there_and_have_room_for_a_long_result(
    page: Page, begin: Begin, story: Story, goal: object, words: str
) -> None:
    story.begin(6.0, "7" * 32, goal)
    story.end(7.0, "7" * 32, {"message": "x" * 300})
    begin(story.told).write(story.told)
    window = page.open("#node=2")
    assert words in page.text("#details .two", "Goal")
    assert window.run("return details.scrollWidth - details.clientWidth") == 0


def test_a_screen_reader_is_told_once_that_the_server_is_gone_not_each_second(
    page: Page, begin: Begin, story: Story, served: Served
) -> None:
    begin(story.told).write(story.told)
    window = page.open()
    page.text("#conn", "Stale")
    window.run(HEARD)
    window.run(SEEN)
    served.stop()
    window.wait_for("seen.size > 2")
    lost = [each for each in window.run("return heard") if "What is missed is filled in" in each]
    assert len(lost) == 1
    served.start()


def test_the_strip_names_leaf_rule_and_time_left_at_any_time(
    page: Page, begin: Begin, story: Story
) -> None:
    story.begin(6.0, "7" * 32)
    story.add(16.1, FeedbackCame, 2, "7" * 32, {"pose": 1.0})
    run = begin(events := story.new())
    run.write(events)
    run.end()
    window = page.open()
    for t, left in ((6.05, "5.0 s left of 5 s"), (7.1, "59.0 s left of 60 s"), (16.1, "50.0 s")):
        window.run("page.seek(arguments[0])", t)
        strip = page.text("#why", left)
        assert "Reach" in strip
        assert ("timeout.accept" if t < 6.1 else "timeout.result") in strip
    window.run("page.seek(1.7)")  # between two goals
    assert "Reach" not in page.text("#why", "Work")
