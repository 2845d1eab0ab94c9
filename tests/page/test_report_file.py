"""The file of `bt-actions report -o run.html`, as Chromium opens it from a disk."""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from bt_actions.cli import main
from bt_actions.events import Event, RunBegan
from bt_actions.page.report import page
from bt_actions.recording.report import reports
from tests.page.conftest import Begin
from tests.page.test_feed import told_of
from tests.support import browser as chromium
from tests.support.recordings import record

NASTY = "</script><img src=x onerror=window.pwned=1><!--<script>"
needs_browser = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")


@pytest.fixture
def opened(window: chromium.Browser, tmp_path: Path) -> Iterator[chromium.Browser]:
    """A window for a file, which loads nothing, and of which the browser must not complain."""
    window.complaints()
    yield window
    assert window.run("return location.protocol") == "file:"
    assert window.run("return performance.getEntriesByType('resource').length") == 0
    assert window.complaints() == []


def show(window: chromium.Browser, path: Path) -> None:
    window.open(path, width=1440, height=900)
    assert window.wait_for("window.page?.shown")


def named(events: list[Event], name: str) -> list[Event]:
    """Events of a tree in which everything is called `name`."""

    def of(event: Event) -> Event:
        if not isinstance(event, RunBegan):
            return event
        nodes = tuple(replace(node, name=name, kind=name) for node in event.nodes)
        return replace(event, nodes=nodes, tree=name, sources={name: name})

    return [of(each) for each in events]


@needs_browser
@pytest.mark.ros
def test_a_report_shows_a_run_from_a_disk_as_the_page_does(
    night: Path, opened: chromium.Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(night))
    path = tmp_path / "run.html"
    assert main(["report", "-o", str(path)]) == 0
    show(opened, path)
    strip = " ".join(opened.run("return document.getElementById('why').innerText").split())
    assert strip.startswith("Why exit code 1 Home: ABORTED aborted by /move_robot;")
    assert opened.run("return document.getElementById('status').innerText") == "Failed"
    assert "once: Home" in opened.run("return document.querySelector('.yaml .at').innerText")
    opened.run("page.seek(1.0)")
    assert opened.wait_for("document.getElementById('status').innerText === 'Running'")
    assert opened.wait_for("location.hash.includes('t=1.000')")


@needs_browser
def test_a_report_with_markup_in_its_names_holds_text(
    opened: chromium.Browser, tmp_path: Path
) -> None:
    first = record(named(told_of(), NASTY))
    path = tmp_path / "run.html"
    path.write_text(page(reports(first)))
    show(opened, path)
    for key in "vot":
        opened.keys(key)
    assert opened.run("return document.getElementById('tree-name').innerText") == NASTY
    assert opened.run("return window.pwned ?? null") is None
    assert opened.run("return document.querySelectorAll('img').length") == 0


@needs_browser
def test_the_policy_of_a_report_stops_a_script_that_is_not_its_own(
    window: chromium.Browser, tmp_path: Path
) -> None:
    path = tmp_path / "run.html"
    text = page(reports(record(told_of())))
    path.write_text(text.replace("</body>", "<script>window.pwned = 1</script></body>"))
    show(window, path)
    assert window.run("return window.pwned ?? null") is None
    assert any("Content Security Policy" in each for each in window.complaints())


@needs_browser
def test_a_report_of_a_run_that_goes_on_says_when_it_was_written(
    opened: chromium.Browser, tmp_path: Path, begin: Begin
) -> None:
    run = begin(told_of())
    run.write(told_of()[:8])
    path = tmp_path / "run.html"
    path.write_text(page(reports(run.first)))
    show(opened, path)
    assert opened.wait_for("document.getElementById('banner').innerText.startsWith('Written')")
    assert opened.run("return document.getElementById('status').innerText") == "Running"


def data(text: str) -> str:
    found = re.search(
        r'<script type="application/json" id="stored">(.*?)</script>', text, re.DOTALL
    )
    assert found is not None
    return found[1]


def test_a_report_without_values_holds_none() -> None:
    first = record(told_of())
    whole, bare = (data(page(reports(first, values=values))) for values in (True, False))
    kinds = [{each["kind"] for each in json.loads(text)[0]["events"]} for text in (whole, bare)]
    gone = {"FeedbackCame", "VariableWritten", "Logged"}
    assert kinds[0] - kinds[1] == gone & kinds[0] != set()
    for event in json.loads(bare)[0]["events"]:
        if event["kind"] == "RunBegan":
            assert event["sources"] == {}
        if event["kind"] == "GoalChanged":
            assert (event["goal"], event["result"]) == (None, None)


def test_a_report_is_small_but_for_its_data() -> None:
    text = page(reports(record(told_of())))
    assert len(gzip.compress(text.replace(data(text), "").encode())) < 100_000
