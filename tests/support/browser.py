"""A headless Chromium for tests, driven by Playwright.

Chromium is a program of the machine, not a Python package. Without one `missing()` says so, for a
test to be skipped with. The browser is given no network but this machine's. While a browser is
open, its thread cannot run an event loop of its own.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from playwright.sync_api import Page, sync_playwright

FLAGS = ["--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
NAMES = ("chromium", "chromium-browser", "google-chrome")
Scheme = Literal["light", "dark"]
CALL = "(given) => (function () { %s }).apply(null, given)"


def missing() -> str:
    """What is not there, or an empty text."""
    return "" if _chromium() else "no chromium on the PATH"


def _chromium() -> str | None:
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One tab."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self._said: list[str] = []
        page.on("console", lambda message: self._said.append(message.text))
        page.on("pageerror", lambda error: self._said.append(str(error)))

    def tab(self) -> Browser:
        """Another tab of the same browser."""
        return Browser(self.page.context.new_page())

    def open(self, path: Path | str, width: int = 1200, height: int = 800) -> None:
        """Show a file or an address anew, in a window of so many pixels inside."""
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.goto("about:blank")
        self.page.goto(path if isinstance(path, str) else path.as_uri())

    def run(self, script: str, *arguments: object) -> Any:
        """What a function body in JavaScript returns; of a promise, what that comes to."""
        return self.page.evaluate(CALL % script, arguments)

    def wait_for(self, script: str, *arguments: object) -> Any:
        """What an expression in JavaScript is, as soon as it is true; at most 10 s."""
        body = CALL % f"return {script}"
        return self.page.wait_for_function(body, arg=arguments, timeout=10_000.0).json_value()

    def keys(self, *names: str) -> None:
        """Press keys one after the other, by their names or characters."""
        for name in names:
            self.page.keyboard.press(name)

    def complaints(self) -> list[str]:
        """What the browser has written to its console since the last call."""
        self.run("")  # so that what was said before has come
        said, self._said = self._said, []
        return said


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser with one tab."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=_chromium(), args=FLAGS, ignore_default_args=["--hide-scrollbars"]
        )
        with chromium:
            yield Browser(chromium.new_context().new_page())
