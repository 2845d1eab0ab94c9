"""Runs of one `bt-actions serve` on the page's front: accepted, canceled, replaced, and killed."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.page.conftest import Served
from tests.page.test_front import CARDS
from tests.serving.conftest import Serve, client, folder, fresh_context, serve_trees, space
from tests.support import browser as chromium
from tests.support.processes import Journal
from tests.support.tree_client import TreeClient

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-"),
]
__all__ = ["client", "folder", "fresh_context", "serve_trees", "space"]


@pytest.fixture
def front(
    no_leaks: None,  # first: what the page's server leaves in its end, is not left by a test
    window: chromium.Browser,
    served: Served,
) -> chromium.Browser:
    window.open(f"{served.address}&runs", width=1440, height=900)
    assert window.wait_for("document.querySelector('#other h1')?.innerText === 'No run goes on'")
    return window


def cards_with(front: chromium.Browser, *words: str) -> list[str]:
    """Wait until each word stands on a card of its own, in the order of the cards."""
    has = " && ".join(f"{CARDS}[{at}].includes({word!r})" for at, word in enumerate(words))
    assert front.wait_for(f"{CARDS}.length === {len(words)} && {has}"), front.run(f"return {CARDS}")
    found: list[str] = front.run(f"return {CARDS}")
    return found


def test_two_runs_at_once_one_is_canceled_and_the_server_is_killed_in_the_other(
    front: chromium.Browser,
    served: Served,
    serve: Callable[..., Journal],
    serve_trees: Serve,
    client: TreeClient,
) -> None:
    serve()
    process = serve_trees("--policy", "parallel", "--max", "2")
    one = client.send("move", "{distance: 50.0}")
    cards_with(front, "executing on")
    client.send("move", "{distance: 60.0}")
    cards_with(front, "executing on", "waiting for its turn on")
    assert front.run("return document.querySelector('#other h1').innerText") == "2 runs go on"
    client.cancel(one)
    client.result(one)
    cards_with(front, "STOPPED after", "executing on")
    process.popen.kill()
    (_, lost) = cards_with(front, "STOPPED after", "Lost for")
    assert "its process was killed, last seen at" in lost
    front.run("document.querySelectorAll('.card')[1].click()")
    assert front.wait_for("document.getElementById('conn').innerText.startsWith('Lost for')")
    assert front.run("return document.getElementById('status').innerText") == "Never finished"
    assert "Go" in front.run("return document.getElementById('why').innerText")


def test_a_run_that_is_replaced_is_stopped_and_the_next_one_goes_on(
    front: chromium.Browser,
    serve: Callable[..., Journal],
    serve_trees: Serve,
    client: TreeClient,
) -> None:
    serve()
    serve_trees("--policy", "replace")
    client.send("move", "{distance: 50.0}")
    cards_with(front, "executing on")
    last = client.send("move", "{distance: 0.2}")
    cards_with(front, "STOPPED after", "SUCCESS after")
    assert client.told(last)[0] == 4
