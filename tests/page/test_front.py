"""The page's front: a card for each run that goes on, and the list of recordings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from bt_actions.events import Event, RunBegan
from bt_actions.page import front
from bt_actions.recording import watching
from bt_actions.recording.folders import Summary
from bt_actions.recording.unrecorded import told
from tests.page.conftest import Begin, Served
from tests.page.test_access import barriers
from tests.page.test_feed import told_of
from tests.recording.test_watching import RUNS, fails
from tests.support import browser as chromium
from tests.support.every_kind import RUN_ID
from tests.support.recordings import record

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")
CARDS = "[...document.querySelectorAll('.card')].map((one) => one.innerText)"
ROWS = "document.querySelectorAll('.records tbody tr:not([hidden])')"


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watching, "EACH", 0.05)
    monkeypatch.setattr(front, "EACH", 0.1)


@pytest.fixture
def opened(window: chromium.Browser, served: Served) -> Iterator[chromium.Browser]:
    window.complaints()
    window.open(f"{served.address}&runs", width=1440, height=900)
    assert window.wait_for("document.querySelector('#other h1')?.innerText.includes('on')")
    yield window
    refused = "net::ERR_CONNECTION_REFUSED", "net::ERR_INCOMPLETE_CHUNKED_ENCODING"
    said = [each for each in window.complaints() if not any(word in each for word in refused)]
    assert said == []


def named(events: list[Event], number: int, tree: str, **more: object) -> list[Event]:
    """The same run, under an id and a name of its own."""
    run_id = f"{number:02x}" * 16
    return [
        replace(each, run_id=run_id, tree=tree, **more) if isinstance(each, RunBegan) else each  # type: ignore[arg-type]
        for each in events
    ]


def test_each_run_that_goes_on_has_a_card_that_says_what_it_waits_for_and_then_why_it_failed(
    opened: chromium.Browser, begin: Begin
) -> None:
    patrol, arm = named(RUNS, 1, "patrol"), named(RUNS, 2, "arm")
    first, second = begin(patrol), begin(arm)
    first.write(patrol)
    second.write(arm)
    assert opened.wait_for(f"{CARDS}.length === 2 && {CARDS}[1].includes('sending')")
    assert opened.run("return document.querySelector('#other h1').innerText") == "2 runs go on"
    cards = opened.run(f"return {CARDS}")
    assert [card.split("\n")[0] for card in cards] == ["arm", "patrol"]  # by their names
    assert "Move, item 1 of 1 of Røt ({at: inf}): sending a goal to /move" in cards[0]
    assert "simulated · robot7 · /all · run 02020202" in cards[0]
    opened.run("window.card = document.querySelectorAll('.card')[1]; card.focus()")
    second.write(fails(arm))
    assert opened.wait_for(f"{CARDS}[0].includes('FAILURE after')")
    assert "Røt / Move" in opened.run(f"return {CARDS}[0]")
    assert opened.run("return card.isConnected && document.activeElement === card")
    assert opened.run("return document.querySelector('#other h1').innerText") == "1 run goes on"
    opened.run("card.click()")
    assert opened.wait_for("page.shown && page.run.info.tree === 'patrol'")


def test_a_run_that_is_not_recorded_has_a_card_that_says_so(opened: chromium.Browser) -> None:
    with told(Summary("ab" * 16, "quiet", 1.8e9), 1.8e9, "--no-record"):
        assert opened.wait_for(f"{CARDS}.length === 1")
        card = opened.run(f"return {CARDS}[0]")
    assert "not recorded since" in card
    assert "--no-record" in card
    assert opened.wait_for(f"{CARDS}.length === 0")


def test_the_recordings_are_listed_the_newest_first_and_can_be_sifted(
    opened: chromium.Browser, begin: Begin
) -> None:
    record(named(told_of(), 1, "patrol"))
    record(named(told_of()[:9], 2, "patrol", where={}), killed=0.5)
    record(named([*RUNS, *fails(RUNS)], 3, "arm"))
    begin(named(RUNS, 4, "night")).write(named(RUNS, 4, "night"))  # has the list drawn anew
    assert opened.wait_for(f"{ROWS}.length === 4")

    def found(query: str = "", ends: str = "", world: str = "") -> list[str]:
        opened.run(
            "const [query, ends, world] = document.querySelectorAll('.filters :is(input, select)');"
            "[query.value, ends.value, world.value] = arguments;"
            "query.dispatchEvent(new Event('input')); ends.dispatchEvent(new Event('change'));",
            query,
            ends,
            world,
        )
        ids = opened.run(f"return [...{ROWS}].map((one) => one.querySelector('code').innerText)")
        return sorted(each[:2] for each in ids)

    assert found() == ["01", "02", "03", "04"]
    assert found(query="PATROL") == ["01", "02"]
    assert found(query="no room") == ["03"]
    assert found(query="0303") == ["03"]
    assert found(ends="Failed") == ["03"]
    assert found(ends="Stopped") == ["01"]
    assert found(ends="Never finished") == ["02"]
    assert found(ends="Goes on") == ["04"]
    assert found(world="real") == ["02"]
    assert found(query="patrol", world="sim") == ["01"]
    assert opened.run("return document.querySelector('.filters output').innerText") == "1 of 4"
    opened.run("document.querySelector('.records tbody tr:not([hidden]) a').click()")
    assert opened.wait_for("page.shown && page.run.key.startsWith('0101')")


def test_where_several_runs_go_on_the_page_opens_with_its_front(
    window: chromium.Browser, served: Served, begin: Begin
) -> None:
    for number in (1, 2):
        begin(named(RUNS, number, "patrol")).write(named(RUNS, number, "patrol"))
    window.open(served.address)
    assert window.wait_for(f"{CARDS}.length === 2")
    window.open(f"{served.address}&run={'01' * 16}")
    assert window.wait_for("page.shown")
    window.run("document.getElementById('switch').click()")
    assert window.wait_for("!document.getElementById('runs').hidden")
    window.run("document.querySelector('#runs .opt:last-child').click()")
    assert window.wait_for(f"{CARDS}.length === 2")


def test_without_its_server_the_front_says_since_when_and_goes_on_when_that_is_back(
    opened: chromium.Browser, served: Served, begin: Begin
) -> None:
    begin(RUNS).write(RUNS)
    assert opened.wait_for(f"{CARDS}.length === 1")
    served.stop()
    assert opened.wait_for("document.querySelector('#other p').innerText.includes('not to be had')")
    assert len(opened.run(f"return {CARDS}")) == 1
    served.start()
    assert opened.wait_for("document.querySelector('#other p').innerText === ''")


def test_a_front_whose_server_had_no_room_for_it_asks_again(
    opened: chromium.Browser, begin: Begin
) -> None:
    begin(RUNS).write(RUNS)
    assert opened.wait_for(f"{CARDS}.length === 1")
    opened.page.route("**/now", lambda route: route.fulfill(status=503), times=1)
    opened.run("location.reload()")
    assert opened.wait_for(
        "document.querySelector('#other p')?.innerText.includes('not to be had')"
    )
    assert opened.wait_for(f"{CARDS}.length === 1")
    assert "503" in opened.complaints()[0]


def test_a_page_that_nobody_sees_keeps_no_stream_and_misses_nothing(
    opened: chromium.Browser, served: Served, begin: Begin
) -> None:
    hide = (
        "Object.defineProperty(document, 'hidden', { value: arguments[0], configurable: true });"
        "document.dispatchEvent(new Event('visibilitychange'));"
    )
    events = told_of()
    run = begin(events)
    run.write(events[:8])
    assert opened.wait_for(f"{CARDS}.length === 1")
    opened.run(hide, True)
    assert opened.run("return document.querySelectorAll('.card').length") == 1
    opened.run(hide, False)
    assert opened.wait_for("document.querySelector('#other p').innerText === ''")
    opened.open(f"{served.address}&run={RUN_ID}")
    assert opened.wait_for("page.shown")
    assert opened.run("return document.title").startswith("Running: ")
    assert opened.run(f"{hide} return document.title", True).startswith("Was running: ")
    assert opened.run("return page.link.stream.source.readyState") == 2
    run.write(events[8:])
    opened.run(hide, False)
    assert opened.wait_for("document.title.startsWith('Stopped: ')")
    assert opened.wait_for("page.run.events.length === arguments[0]", len(events))
    numbers = opened.run("return page.run.events.map((each) => each.at[0])")
    assert numbers == [each.at.number for each in events]


@pytest.mark.parametrize("width", [390, 1024, 1920])
def test_the_front_is_not_wider_than_the_window(
    opened: chromium.Browser, served: Served, width: int
) -> None:
    record(told_of())
    opened.open(f"{served.address}&runs", width=width, height=900)
    assert opened.wait_for(f"{ROWS}.length === 1")
    assert opened.run("return document.documentElement.scrollWidth") <= width
    other = "document.getElementById('other')"
    assert opened.run(f"return {other}.scrollWidth - {other}.clientWidth") <= 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_there_are_no_barriers_on_the_front(
    opened: chromium.Browser, served: Served, begin: Begin, scheme: chromium.Scheme
) -> None:
    record(told_of())
    begin(named(RUNS, 1, "patrol")).write(named(RUNS, 1, "patrol"))
    opened.page.emulate_media(color_scheme=scheme)
    opened.open(f"{served.address}&runs", width=1440, height=900)
    assert opened.wait_for(f"{ROWS}.length === 2 && {CARDS}.some((one) => one.includes('patrol'))")
    assert barriers(opened) == []
