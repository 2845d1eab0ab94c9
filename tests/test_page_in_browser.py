"""The page of a tree as a reader has it: in Chromium, with pointer, keyboard and finger.

Skipped where there is no Chromium.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from bt_actions import MoveRobot, load_tree, render
from bt_actions.document.cards import cards_of
from bt_actions.document.describing import nodes_of
from tests.support import browser as chromium

TREES = Path(__file__).parents[1] / "trees"
NASTY = "</script><img src=x onerror=window.pwned=1><svg onload=window.pwned=1>"

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")

Open = Callable[..., chromium.Browser]
CARD = "document.getElementById('card')"
SHOWN = f"!{CARD}.hidden && {CARD}.textContent"


@pytest.fixture(scope="module")
def window() -> Iterator[chromium.Browser]:
    with chromium.browser() as opened:
        yield opened


@pytest.fixture
def show(window: chromium.Browser, tmp_path: Path) -> Iterator[Open]:
    """Show a tree; when the test is over the browser must have had nothing to complain about."""

    def shown(
        root: Behaviour, scheme: chromium.Scheme = "light", width: int = 1200
    ) -> chromium.Browser:
        path = tmp_path / "tree.html"
        render.write(nodes_of(root), path, cards=cards_of(root))
        window.page.emulate_media(color_scheme=scheme)
        window.page.mouse.move(0, 0)
        window.open(path, width=width)
        return window

    yield shown
    assert window.complaints() == []


def sample() -> Behaviour:
    return load_tree(TREES / "pick_and_place.yaml")


def long(nodes: int) -> Behaviour:
    root = Sequence("All", memory=True)
    for number in range(nodes // 10):
        legs = [MoveRobot(f"Leg {number}.{leg}", 1.0) for leg in range(9)]
        root.add_child(Sequence(f"Part {number}", memory=True, children=legs))
    return root


def middle(window: chromium.Browser, name: str, part: str = ".shape") -> tuple[float, float]:
    """Where a node is in the window."""
    x, y = window.run(
        "const group = [...document.querySelectorAll('.node')]"
        ".find((one) => one.getAttribute('aria-label').startsWith(arguments[0] + ','));"
        "const box = group.querySelector(arguments[1]).getBoundingClientRect();"
        "return [box.x + box.width / 2, box.y + box.height / 2];",
        name,
        part,
    )
    return x, y


def names(window: chromium.Browser) -> list[str]:
    """The nodes that are drawn, in reading order."""
    found = window.run(
        "return [...document.querySelectorAll('.node')]"
        ".map((one) => one.getAttribute('aria-label').split(',')[0])"
    )
    return list(found)


def focused(window: chromium.Browser) -> str:
    label = window.run("return document.activeElement.getAttribute('aria-label') || ''")
    return str(label).partition(",")[0]


def test_every_node_is_drawn_in_its_shape_and_nothing_is_loaded(show: Open) -> None:
    root = sample()
    window = show(root)
    assert names(window) == [node.name for node in nodes_of(root)]
    shapes = window.run("return [...document.querySelectorAll('.shape')].map((one) => one.tagName)")
    assert shapes[:3] == ["polygon", "rect", "ellipse"]
    assert window.run("return performance.getEntriesByType('resource').length") == 0


def test_pointing_at_a_node_shows_its_card_until_the_pointer_has_left_both(show: Open) -> None:
    window = show(sample())
    window.page.mouse.move(*middle(window, "Grasp"))
    text = window.wait_for(SHOWN)
    for part in ("gripper: Grasp", "result.stalled", "pick_and_place.yaml:", "Gripper.Goal"):
        assert part in text
    x, y = window.run(f"const b = {CARD}.getBoundingClientRect(); return [b.x + 60, b.y + 40]")
    window.page.mouse.move(x, y)
    window.run("window.later = performance.now() + 400")
    window.wait_for("performance.now() > window.later")
    assert not window.run(f"return {CARD}.hidden")
    window.page.mouse.move(2, 400)
    assert window.wait_for(f"{CARD}.hidden") is True


def test_a_tap_keeps_the_card_and_escape_closes_it(show: Open) -> None:
    window = show(sample(), width=390)
    x, y = middle(window, "Deliver the part")
    touch = window.page.context.new_cdp_session(window.page)
    for kind, points in (("touchStart", [{"x": x, "y": y}]), ("touchEnd", [])):
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert "fallback" in window.wait_for(SHOWN)
    window.keys("Escape")
    assert window.wait_for(f"{CARD}.hidden") is True


def test_the_keyboard_walks_folds_and_shows_cards(show: Open) -> None:
    window = show(sample())
    window.run("document.querySelector('#theme').focus()")
    window.keys("Tab")
    assert focused(window) == "Deliver the part"
    window.keys("ArrowDown")
    assert focused(window) == "Pick and place"
    assert "Pick and place" in window.wait_for(SHOWN)
    before = names(window)
    window.keys("ArrowLeft")
    expanded = "return document.activeElement.getAttribute('aria-expanded')"
    assert window.run(expanded) == "false"
    assert focused(window) == "Pick and place"
    assert len(names(window)) < len(before)
    window.keys("Enter")
    assert window.run(expanded) == "true"
    assert names(window) == before
    window.keys("ArrowRight", "ArrowRight", "ArrowLeft")
    assert focused(window) == "Pick and place"
    window.keys("End")
    assert focused(window) == before[-1]
    window.keys("Home", "Tab")
    assert window.run("return document.activeElement.id") == "card"
    window.keys("Escape")
    assert focused(window) == "Deliver the part"


def test_a_click_on_the_knob_folds_and_the_node_stays_under_the_pointer(show: Open) -> None:
    window = show(long(200))
    window.page.mouse.click(*middle(window, "Part 9", ".knob"))
    assert len(names(window)) == 30
    place = middle(window, "Part 9")
    window.page.mouse.click(*middle(window, "Part 8", ".knob"))
    window.page.mouse.click(*middle(window, "Part 9", ".knob"))
    assert len(names(window)) == 30
    assert place[1] != pytest.approx(middle(window, "Part 9")[1], abs=20.0)
    place = middle(window, "Part 8")
    window.page.mouse.click(*middle(window, "Part 8", ".knob"))
    assert middle(window, "Part 8") == pytest.approx(place, abs=2.0)
    assert len(names(window)) == 21


def test_a_large_tree_starts_folded_and_unfolds_and_folds(show: Open) -> None:
    window = show(long(200))
    assert len(names(window)) == 21
    window.run("document.getElementById('unfold').click()")
    assert len(names(window)) == 201
    window.run("document.getElementById('fold').click()")
    assert len(names(window)) == 21


def test_a_tree_of_10_000_nodes_unfolds_as_far_as_a_browser_likes(show: Open) -> None:
    window = show(long(10_000))
    window.run("document.getElementById('unfold').click()")
    assert len(names(window)) == 1001


def test_searching_finds_a_folded_node_and_shows_it(show: Open) -> None:
    window = show(long(200))
    assert "Leg 7.3" not in names(window)
    window.keys("/", *"leg 7.3")
    assert window.run("return document.getElementById('found').textContent") == "1 found"
    window.keys("Enter")
    assert "Leg 7.3" in names(window)
    assert "MoveRobot.Goal" in window.wait_for(SHOWN)
    assert window.run("return document.querySelectorAll('.node.hit').length") == 1


@pytest.mark.parametrize("name", ["Leg 19.8", "Leg 0.0", "Part 9"])
@pytest.mark.parametrize("way", ["search", "keyboard"])
def test_on_a_phone_what_is_found_or_gone_to_is_above_the_card(
    name: str, way: str, show: Open
) -> None:
    window = show(long(200), width=390)
    if way == "search":
        window.keys("/", *name, "Enter")
    else:
        window.run("document.getElementById('unfold').click()")
        window.run("document.querySelector('#n0').focus()")
        window.keys(*["ArrowDown"] * names(window).index(name))
    window.wait_for(SHOWN)
    for height in (800, 500):  # its keyboard opens
        window.page.set_viewport_size({"width": 390, "height": height})
        assert window.wait_for(
            "(() => { const box = document.querySelector('.node.shown .shape')"
            ".getBoundingClientRect();"
            "const above = box.top - document.getElementById('view').getBoundingClientRect().top;"
            f"return innerHeight === {height} && above >= 0"
            f" && box.bottom <= {CARD}.getBoundingClientRect().top; }})()"
        )


@pytest.mark.parametrize("width", [390, 1200])
def test_a_large_tree_opens_at_its_root_and_its_first_child(width: int, show: Open) -> None:
    window = show(long(10_000), width=width)
    for name in ("All", "Part 0"):
        x, y = middle(window, name)
        assert 0 < x < width
        assert 50 < y < 800


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_can_be_read_in_light_and_dark(scheme: chromium.Scheme, show: Open) -> None:
    window = show(sample(), scheme=scheme)
    for _ in range(2):
        window.page.mouse.move(0, 0)
        window.page.mouse.move(*middle(window, "Grasp"))
        window.wait_for(SHOWN)
        assert window.run(CONTRAST) >= 4.5
        window.run("document.getElementById('theme').click()")


def test_the_system_says_light_or_dark_and_the_button_overrules_it(show: Open) -> None:
    ground = "return getComputedStyle(document.body).backgroundColor"
    light = show(sample(), scheme="light").run(ground)
    window = show(sample(), scheme="dark")
    dark = window.run(ground)
    assert dark != light
    assert window.run("return document.querySelector('#theme').ariaPressed") == "true"
    window.run("document.getElementById('theme').click()")
    assert window.run(ground) == light
    assert window.run("return document.querySelector('#theme').ariaPressed") == "false"


def test_a_tree_with_a_script_for_a_name_does_nothing(show: Open) -> None:
    leaf = MoveRobot(NASTY, 0.0, action_name=NASTY, save={NASTY: "result.final_pose"})
    window = show(Sequence(NASTY, memory=True, children=[leaf]))
    window.run("document.querySelector('.node:last-child').focus()")
    window.keys("ArrowUp", "ArrowDown")
    assert NASTY in window.wait_for(SHOWN)
    assert window.run("return window.pwned ?? null") is None
    assert window.run("return document.querySelectorAll('img, script, svg').length") == 3


def test_the_policy_stops_a_script_that_is_not_the_page_s_own(
    window: chromium.Browser, tmp_path: Path
) -> None:
    text = render.content(nodes_of(sample()), "html").decode()
    (path := tmp_path / "tree.html").write_text(
        text.replace("</header>", "</header><img src=x onerror=window.pwned=1>")
    )
    window.open(path)
    assert window.run("return window.pwned ?? null") is None
    assert "Content Security Policy" in "\n".join(window.complaints())


CONTRAST = """
const channels = (colour) => colour.match(/[\\d.]+/g).map(Number);
const light = ([r, g, b]) => [r, g, b].map((one) => one / 255)
  .map((one) => (one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4))
  .reduce((sum, one, at) => sum + one * [0.2126, 0.7152, 0.0722][at], 0);
const ground = (element) => {
  const shape = element.closest('.fold')?.querySelector('.knob') ||
    element.closest('.node')?.querySelector('.shape');
  if (shape) return getComputedStyle(shape).fill;
  for (; element; element = element.parentElement) {
    const colour = getComputedStyle(element).backgroundColor;
    if (channels(colour)[3] !== 0) return colour;
  }
};
return Math.min(...[...document.body.querySelectorAll('*')]
  .filter((one) => one.checkVisibility() && [...one.childNodes].some((child) => child.data?.trim()))
  .map((one) => {
    const style = getComputedStyle(one);
    const colours = [one.closest('svg') ? style.fill : style.color, ground(one)];
    const pair = colours.map(channels).map(light);
    return (Math.max(...pair) + 0.05) / (Math.min(...pair) + 0.05);
  }));
"""
"""The least contrast of any text that is seen with what is behind it, as WCAG 2 computes it."""
