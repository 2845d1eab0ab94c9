"""Tabs of one browser that show the same share one stream, and none of them misses anything."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import pytest

from bt_actions.events import Event
from bt_actions.page import server
from tests.page.conftest import SHOWN, Begin, Served
from tests.page.test_feed import told_of
from tests.page.test_front import named
from tests.support import browser as chromium
from tests.support.recordings import Going
from tests.support.waiting import until

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")
CONNECTIONS = 6
"""What a browser has to a server."""
MANY = 8
"""Tabs."""
HIDE = (
    "Object.defineProperty(document, 'hidden', { value: true });"
    "document.dispatchEvent(new Event('visibilitychange'));"
)
PATIENT = (
    "const wait = window.setTimeout;"
    "window.setTimeout = (then, after) => (after === 3000 ? 0 : wait(then, after));"
)
"""Has a tab wait for ever for one that leads and says nothing."""
LOCKLESS = "Object.defineProperty(Navigator.prototype, 'locks', { value: undefined })"
Tab = Callable[..., chromium.Browser]


@pytest.fixture
def streams(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """The streams that the server has open."""
    found: list[object] = []

    def counted(tell: Callable[..., AsyncIterator[bytes]]) -> Callable[..., AsyncIterator[bytes]]:
        async def one(*of: Any) -> AsyncIterator[bytes]:
            found.append(mark := object())
            try:
                async for each in tell(*of):
                    yield each
            finally:
                found.remove(mark)

        return one

    monkeypatch.setattr(server, "told", counted(server.told))
    monkeypatch.setattr(server, "standing", counted(server.standing))
    return found


@pytest.fixture
def tab(streams: list[object], window: chromium.Browser, served: Served) -> Iterator[Tab]:
    """Open a tab, and wait until its page is there."""
    opened: list[chromium.Browser] = []

    def one(shown: str = SHOWN, place: str = "", before: str = PATIENT) -> chromium.Browser:
        opened.append(made := window.tab())
        made.page.add_init_script(before)
        made.open(f"{served.address}{place}")
        assert made.wait_for(shown)
        return made

    yield one
    for each in opened:
        each.page.close()


@pytest.fixture
def events() -> list[Event]:
    return told_of(rounds=9)


@pytest.fixture
def run(begin: Begin, events: list[Event]) -> Going:
    """A run of which a part has happened."""
    run = begin(events)
    run.write(events[:10])
    return run


def has_all(tab: chromium.Browser, events: list[Event]) -> None:
    """Wait for all events, and look for each of them once."""
    assert tab.wait_for("page.run.events.length >= arguments[0]", len(events))
    numbers = tab.run("return page.run.events.map((each) => each.at[0])")
    assert numbers == [each.at.number for each in events]


def test_tabs_of_a_run_share_one_stream_and_each_shows_all_to_its_end(
    tab: Tab, streams: list[object], run: Going, events: list[Event]
) -> None:
    tabs = [tab() for _ in range(MANY)]
    until(lambda: len(streams) == 1, what="one stream is left")
    for each in events[10:]:
        run.write([each])
    for one in tabs:
        has_all(one, events)
    assert len(streams) == 1
    run.end()
    for one in tabs:
        assert one.wait_for("page.link.conn === 'replay'")
    until(lambda: not streams)


@pytest.mark.parametrize("way", ["is closed", "is hidden"])
def test_when_the_tab_that_leads_goes_another_goes_on_without_a_gap(
    tab: Tab, streams: list[object], run: Going, events: list[Event], way: str
) -> None:
    leader, *others = tab(), tab(), tab()
    until(lambda: len(streams) == 1)
    assert leader.run("return page.link.stream.leads")
    run.write(events[10:30])
    if way == "is closed":
        leader.page.close()
    else:
        leader.run(HIDE)
    run.write(events[30:])
    for one in others:
        has_all(one, events)
    until(lambda: len(streams) == 1)


def test_a_tab_that_lacks_something_asks_for_all_that_is_behind_what_it_has(
    tab: Tab, streams: list[object], run: Going, events: list[Event]
) -> None:
    leader, other = tab(), tab()
    until(lambda: len(streams) == 1)
    leader.run("page.link.stream.channel.postMessage = () => {}")  # is lost, once
    run.write(events[10:30])
    has_all(leader, events[:30])
    leader.run("delete page.link.stream.channel.postMessage")
    has_all(other, events[:30])
    run.write(events[30:])
    has_all(other, events)
    until(lambda: len(streams) == 1)


def test_a_tab_that_hears_nothing_from_the_one_that_leads_asks_by_itself(
    tab: Tab, streams: list[object], run: Going, events: list[Event]
) -> None:
    leader, other = tab(), tab(before="")
    until(lambda: len(streams) == 1)
    leader.run("page.link.stream.channel.postMessage = () => {}")
    run.write(events[10:])
    has_all(other, events)
    assert len(streams) == 2


def test_tabs_lose_the_server_and_share_a_stream_again_when_it_is_back(
    tab: Tab, streams: list[object], run: Going, events: list[Event], served: Served
) -> None:
    tabs = [tab() for _ in range(3)]
    until(lambda: len(streams) == 1)
    served.stop()
    for one in tabs:
        assert one.wait_for("page.link.conn === 'lost'")
    run.write(events[10:])
    served.start()
    for one in tabs:
        has_all(one, events)
    until(lambda: len(streams) == 1)


@pytest.mark.usefixtures("run")
def test_without_web_locks_each_tab_has_its_own(tab: Tab, streams: list[object]) -> None:
    tabs = [tab(before=LOCKLESS) for _ in range(2)]
    for one in tabs:
        assert one.wait_for("page.link.conn !== 'lost'")
    assert len(streams) == 2


@pytest.mark.usefixtures("run")
def test_the_front_has_one_stream_in_all_tabs(tab: Tab, streams: list[object]) -> None:
    tabs = [tab("document.querySelectorAll('.card').length === 1", "&runs") for _ in range(MANY)]
    until(lambda: len(streams) == 1)
    for one in tabs:
        assert one.run("return document.querySelectorAll('.card').length") == 1


def test_more_tabs_of_different_runs_than_a_browser_has_connections_say_so_and_then_go_on(
    tab: Tab, streams: list[object], begin: Begin, events: list[Event]
) -> None:
    ids = []
    for number in range(1, CONNECTIONS + 2):
        mine = named(events, number, f"tree{number}")
        begin(mine).write(mine[:10])
        ids.append(f"{number:02x}" * 16)
    shown = [tab(place=f"&run={each}") for each in ids[: CONNECTIONS - 1]]
    crowded = [
        tab("document.getElementById('other').innerText.includes('Five windows')", place)
        for place in ("&runs", f"&run={ids[-2]}", f"&run={ids[-1]}")
    ]
    assert len(streams) == len(shown)
    for one in shown[:2]:
        one.page.close()
    shown[2].run(HIDE)
    for one in crowded[1:]:
        assert one.wait_for(SHOWN)
    assert crowded[0].wait_for("document.querySelectorAll('.card').length > 5")
    assert len(streams) == CONNECTIONS - 1
