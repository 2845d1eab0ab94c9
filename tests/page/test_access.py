"""The page for every reader: without barriers, by keyboard alone, small, enlarged, in colours that
a system forces, and without motion."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe

from bt_actions import load_tree, render
from bt_actions.document.cards import cards_of
from bt_actions.document.describing import nodes_of
from tests.page.conftest import ROOT, Page, Served
from tests.support import browser as chromium
from tests.support.waiting import until

pytestmark = [
    pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-"),
    pytest.mark.ros,
]
PANES = ["tab=details", "tab=values", "tab=log&t=2.0", "view=graph", "pane=time", "pane=log"]
RULES = {
    "runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
    "resultTypes": ["violations"],
}
FOCUS = "return document.activeElement.getAttribute('aria-label') || document.activeElement.id"


def barriers(window: chromium.Browser) -> list[str]:
    """What axe-core finds on the page as it is now."""
    found = Axe().run(window.page, options=RULES).response["violations"]
    return [f"{each['id']}: {node['html'][:200]}" for each in found for node in each["nodes"]]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1920, 1440, 390])
def test_there_are_no_barriers_on_any_pane(over: Page, scheme: chromium.Scheme, width: int) -> None:
    over.window.page.emulate_media(color_scheme=scheme)
    for pane in PANES:
        assert barriers(over.open(f"#{pane}", width=width)) == []


def test_there_are_no_barriers_in_help_and_in_the_choice_of_runs(over: Page) -> None:
    window = over.open()
    for opener, opened in (("help-open", "#help"), ("switch", "#runs .opt")):
        window.run(f"document.getElementById('{opener}').click()")
        window.wait_for(f"document.querySelector('{opened}')?.checkVisibility()")
        assert barriers(window) == []
        window.keys("Escape")


def test_there_are_no_barriers_where_there_is_no_run(
    window: chromium.Browser, served: Served
) -> None:
    window.open(served.address)
    assert window.wait_for("document.querySelector('#other h1')?.innerText === 'No run yet'")
    assert barriers(window) == []


def test_there_are_no_barriers_in_a_tree_that_is_drawn(
    window: chromium.Browser, tmp_path: Path
) -> None:
    path = tmp_path / "tree.html"
    root = load_tree(ROOT / "trees" / "pick_and_place.yaml")
    render.write(nodes_of(root), path, cards=cards_of(root))
    window.open(path, width=1440)
    window.keys("Tab")
    assert barriers(window) == []
    click = "dispatchEvent(new Event('click', { bubbles: true }))"
    window.run(f"document.querySelector('.node').{click}")
    assert window.wait_for("!document.getElementById('card').hidden")
    assert barriers(window) == []


def test_the_tree_is_walked_folded_and_searched_by_keys_alone(over: Page) -> None:
    window = over.open()
    assert window.wait_for("document.querySelector('.row[aria-selected=true]') !== null")
    window.run("document.querySelector('.row[aria-selected=true]').focus()")
    assert window.run(FOCUS).startswith("Home, MoveRobot, ABORTED")
    window.keys("ArrowLeft")  # to the parent
    assert window.wait_for(f"(() => {{ {FOCUS} }})().startsWith('Home in time')")
    window.keys("ArrowLeft")  # folds it
    folded = "document.activeElement.getAttribute('aria-expanded')"
    assert window.wait_for(f"{folded} === 'false'")
    window.keys("ArrowRight")
    assert window.wait_for(f"{folded} === 'true'")
    window.keys("Home")
    assert window.wait_for(f"(() => {{ {FOCUS} }})().startsWith('Shift, sequence')")
    window.keys("End", "ArrowUp", "ArrowDown", "Enter")
    window.keys("/")
    assert window.run(FOCUS) == "Find a node"
    window.keys(*"grasp", "Enter")
    assert over.text("#details h2", "Grasp")
    assert window.run("return document.getElementById('found').textContent") == "1 of 1"


def test_all_that_can_be_pressed_is_reached_by_tab_and_seen_to_be(over: Page) -> None:
    window = over.open()
    window.run("document.querySelector('.skip').focus()")
    reached = []
    for _ in range(60):
        window.keys("Tab")
        reached.append(window.run("return document.activeElement.id"))
        ring = "const { outlineStyle, backgroundColor } = getComputedStyle(document.activeElement);"
        ring += "return document.activeElement === document.body || outlineStyle !== 'none'"
        assert window.run(f"{ring} || document.activeElement.matches('.split')"), reached[-1]
        if reached[-1] == "lanes":
            break
    wanted = ["switch", "query", "details", "split-side", "tab-details", "split-time"]
    assert set(wanted) <= set(reached)
    assert [each for each in reached if each.startswith("row-")] != []
    before = window.run("return page.t")
    window.keys("ArrowLeft")
    assert window.wait_for("page.t < arguments[0]", before)


def test_a_splitter_is_moved_by_keys_and_says_where_it_is(over: Page) -> None:
    window = over.open()
    now = "+document.getElementById('split-side').getAttribute('aria-valuenow')"
    wide = window.run("document.getElementById('split-side').focus(); return side.offsetWidth")
    assert window.run(f"return {now}") == wide
    window.keys("ArrowLeft")
    assert window.wait_for(f"side.offsetWidth === {wide} + 24 && {now} === {wide} + 24")


@pytest.mark.parametrize("pane", ["tree", "time", "details", "values", "log"])
def test_at_200_percent_each_pane_has_the_window(over: Page, pane: str) -> None:
    window = over.window
    window.open(f"{over.place}#pane={pane}", width=720, height=450)  # half of 1440 by 900
    assert window.wait_for("window.page?.shown")
    assert window.run("return document.documentElement.scrollWidth") <= 720
    height = window.run(f"return document.getElementById('{pane}').clientHeight")
    assert height > 200
    assert window.run("return document.getElementById('dock').checkVisibility()")


def test_forced_colours_show_what_is_chosen_and_how_nodes_stand(over: Page) -> None:
    over.window.page.emulate_media(forced_colors="active")
    try:
        window = over.open("#t=4.0")
        colour = (
            "const colour = (id) => getComputedStyle(document.getElementById(id)).backgroundColor;"
        )
        assert window.run(f"{colour} return colour('as-outline') !== colour('as-graph')")
        assert window.run(f"{colour} return colour('tab-details') !== colour('tab-log')")
        row = "getComputedStyle(document.querySelector('.row[aria-selected=true]'))"
        assert window.run(f"return {row}.outlineStyle") == "solid"
        phases = "[...document.querySelectorAll('.ph-exec')]"
        assert window.run(
            f"return new Set({phases}.map((one) => getComputedStyle(one).backgroundColor)).size > 1"
        )
    finally:
        over.window.page.emulate_media(forced_colors="null")


def test_nothing_moves_by_itself_where_nothing_comes(over: Page) -> None:
    window = over.open("#t=4.0")
    assert window.run("return document.querySelectorAll('.st-running').length") > 2
    assert window.run("return document.getAnimations().length") == 0


def heard(window: chromium.Browser, role: str) -> list[str]:
    """The names of what has a role, in the order in which a screen reader has them."""
    session = window.page.context.new_cdp_session(window.page)
    nodes = {each["nodeId"]: each for each in session.send("Accessibility.getFullAXTree")["nodes"]}

    def under(node: dict[str, Any]) -> Iterator[str]:
        if node.get("role", {}).get("value") == role:
            yield node["name"]["value"]
        for child in node.get("childIds", ()):
            yield from under(nodes[child])

    return list(under(next(iter(nodes.values()))))


def test_a_screen_reader_has_the_rows_of_the_outline_in_the_order_of_the_tree(over: Page) -> None:
    window = over.open()
    y = "new DOMMatrix(getComputedStyle(one).transform).f"
    rows = (
        f"[...document.querySelectorAll('.row:not([hidden])')].map((one) => [{y}, one.ariaLabel])"
    )

    def agree() -> bool:
        seen = [label for _, label in sorted(window.run(f"return {rows}"))]
        return len(seen) > 20 and heard(window, "treeitem") == seen

    for top in (0, 200, 100):
        window.run("document.getElementById('tree-scroll').scrollTop = arguments[0]", top)
        until(agree)


def test_a_screen_reader_has_a_word_for_what_a_shape_tells(over: Page) -> None:
    window = over.open()
    assert "/move_robot: in sight" in heard(window, "image")
    assert "Home: ABORTED at 00:05." in " ".join(heard(window, "button"))
    window.run("document.getElementById('switch').click()")
    assert window.wait_for("document.querySelector('#runs .opt')?.checkVisibility()")
    assert " Failed · " in heard(window, "option")[0]
