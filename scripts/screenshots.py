"""Takes the pictures of the page of a run in README.md and docs/, in headless Chromium.

`python -m scripts.screenshots`. What they show is recorded now, in a simulation: the demo, step by
step, and a run that failed. Where there is no Chromium, the pictures stay as they are.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from tests.support.browser import Browser, browser, missing

if TYPE_CHECKING:
    from PIL.Image import Image

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"
PICTURES = {IMAGES / "page.webp", IMAGES / "page_failed.webp", IMAGES / "page_drawing.webp"}
DEMO = "run trees/pick_and_place.yaml --sim --speed 2 --check-part 5.0"
NIGHT = "run examples/night/night.yaml --sim --speed 10 --fault move_robot:12:abort"
STEP = 0.25
"""Seconds of the run between two pictures of the moving one."""
SIZE = 1280, 800


def main() -> int:
    """Take all of them."""
    if missing():
        print(f"the pictures of the page stay as they are: {missing()}", file=sys.stderr)
        return 0
    with tempfile.TemporaryDirectory() as folder, browser() as window:
        _open(window, Path(folder), DEMO, "#node=1")
        first, *others = _moving(window)
        first.save(
            IMAGES / "page.webp",
            save_all=True,
            append_images=others,
            duration=[*[round(STEP * 1000)] * len(others), 3000],
            loop=0,
            quality=70,
            method=6,
        )
        _open(window, Path(folder), NIGHT, "")
        _seen(window).save(IMAGES / "page_failed.webp", quality=80, method=6)
        window.page.emulate_media(color_scheme="dark")
        _open(window, Path(folder), NIGHT, "#view=graph")
        _seen(window).save(IMAGES / "page_drawing.webp", quality=80, method=6)
    return 0


def _open(window: Browser, folder: Path, command: str, place: str) -> None:
    """Record a run, and open its report."""
    environment = {**os.environ, "XDG_STATE_HOME": str(folder)}
    file = folder / "run.html"
    for words in (command.split(), ["report", "-o", str(file)]):
        subprocess.run(
            [sys.executable, "-m", "bt_actions.cli", *words],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            check=words[0] == "report",
        )
    window.open(file.as_uri() + place, *SIZE)
    assert window.wait_for("window.page?.shown")


def _moving(window: Browser) -> Iterator[Image]:
    """Yield what is seen from the run's beginning to its end."""
    head = window.run("return page.head")
    window.run("page.set_follow(true)")
    for number in range(round(head / STEP) + 1):
        window.run("page.seek(arguments[0]); page.jump_running()", number * STEP)
        yield _seen(window)
    window.run("page.go_live()")
    yield _seen(window)


def _seen(window: Browser) -> Image:
    """Return what is seen, once all is painted."""
    from PIL.Image import open as read  # here: a test only reads which pictures there are

    window.run("return new Promise((d) => requestAnimationFrame(() => setTimeout(d, 100)))")
    return read(io.BytesIO(window.page.screenshot())).convert("RGB")


if __name__ == "__main__":
    sys.exit(main())
