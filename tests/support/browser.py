"""A headless Chromium for tests, driven by its chromedriver over the WebDriver protocol.

Both are programs of the machine, not Python packages. Without them `missing()` says what is not
there, for a test to be skipped with. The browser is given no network but this machine's.
"""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import subprocess
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)
KEYS = {"Down": "\ue015", "Up": "\ue013", "Left": "\ue012", "Right": "\ue014", "Enter": "\ue007"}
KEYS |= {"Escape": "\ue00c", "Tab": "\ue004", "Home": "\ue011", "End": "\ue010"}


def missing() -> str:
    """What is not there, or an empty text."""
    needed = {"chromium": _chromium(), "chromedriver": shutil.which("chromedriver")}
    return " and ".join(f"no {name} on the PATH" for name, path in needed.items() if path is None)


def _chromium() -> str | None:
    names = ("chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if (path := shutil.which(name))), None)


class Browser:
    """One window."""

    def __init__(self, session: str) -> None:
        self._session = session

    def open(self, path: Path | str, width: int = 1200, height: int = 800) -> None:
        """Show a file or an address, in a window of so many pixels inside."""
        self.resize(width, height)
        _call(f"{self._session}/url", url=path if isinstance(path, str) else path.as_uri())

    def resize(self, width: int, height: int) -> None:
        """Give the window so many pixels inside."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.cdp("Emulation.setDeviceMetricsOverride", **metrics)

    def scheme(self, name: str) -> None:
        """Prefer "light" or "dark", as the reader's system does."""
        feature = {"name": "prefers-color-scheme", "value": name}
        self.cdp("Emulation.setEmulatedMedia", features=[feature])

    def run(self, script: str, *arguments: object) -> Any:
        """What a function body in JavaScript returns."""
        return _call(f"{self._session}/execute/sync", script=script, args=list(arguments))

    def wait_for(self, script: str, *arguments: object) -> Any:
        """What an expression in JavaScript is, as soon as it is true; at most 10 s."""
        body = (
            "const given = [...arguments], done = given.pop(), end = performance.now() + 10000;"
            f"const look = () => {{ const found = (function () {{ return {script} }})(...given);"
            "if (found || performance.now() > end) done(found); else setTimeout(look, 20); };"
            "look();"
        )
        return self.wait(body, *arguments)

    def wait(self, script: str, *arguments: object) -> Any:
        """What a function body in JavaScript hands to the last of its arguments, a function."""
        return _call(f"{self._session}/execute/async", script=script, args=list(arguments))

    def keys(self, *names: str) -> None:
        """Press keys one after the other: names in KEYS, or single characters."""
        actions = []
        for name in names:
            value = KEYS.get(name, name)
            actions += [{"type": "keyDown", "value": value}, {"type": "keyUp", "value": value}]
        self._act({"type": "key", "id": "keyboard", "actions": actions})

    def point(self, x: float, y: float, *, click: bool = False, touch: bool = False) -> None:
        """Move the pointer to a place in the window, and click or tap there."""
        move = {"type": "pointerMove", "duration": 0, "x": round(x), "y": round(y)}
        actions = [move]
        if click:
            actions += [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        kind = "touch" if touch else "mouse"
        source = {"type": "pointer", "id": kind, "parameters": {"pointerType": kind}}
        self._act(source | {"actions": actions})

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Press the mouse at one place of the window, move it to another, and let go."""
        moves = [
            {"type": "pointerMove", "duration": 0, "x": round(x), "y": round(y)}
            for x, y in (begin, end)
        ]
        actions = [
            moves[0],
            {"type": "pointerDown", "button": 0},
            moves[1],
            {"type": "pointerUp", "button": 0},
        ]
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
        self._act(mouse | {"actions": actions})

    def picture(self, path: Path) -> None:
        """Write what is seen as a PNG."""
        path.write_bytes(base64.b64decode(_call(f"{self._session}/screenshot", "GET")))

    def complaints(self) -> list[str]:
        """What the browser has written to its console since the last call."""
        return [entry["message"] for entry in _call(f"{self._session}/se/log", type="browser")]

    def cdp(self, command: str, **parameters: object) -> Any:
        """Call Chromium's own protocol."""
        return _call(f"{self._session}/goog/cdp/execute", cmd=command, params=parameters)

    def _act(self, source: Mapping[str, object]) -> None:
        _call(f"{self._session}/actions", actions=[source])


@contextmanager
def browser(home: Path) -> Iterator[Browser]:
    """A browser that keeps its files in `home`."""
    driver = shutil.which("chromedriver")
    assert driver is not None
    environment = {"PATH": os.environ["PATH"], "HOME": str(home), "LANG": "C.UTF-8"}
    with subprocess.Popen(
        [driver, "--port=0"], stdout=subprocess.PIPE, env=environment, text=True
    ) as process:
        try:
            assert process.stdout is not None
            lines = (re.search(r"successfully on port (\d+)", line) for line in process.stdout)
            port = next(found[1] for found in lines if found)
            url = f"http://127.0.0.1:{port}/session"
            options = {"binary": _chromium(), "args": [*FLAGS, f"--user-data-dir={home / 'user'}"]}
            wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
            session = _call(url, capabilities={"alwaysMatch": wanted})["sessionId"]
            try:
                yield Browser(f"{url}/{session}")
            finally:
                _call(f"{url}/{session}", "DELETE")
        finally:
            process.terminate()


def _call(address: str, method: str = "POST", /, **body: object) -> Any:
    data = json.dumps(body).encode() if method == "POST" else None
    request = urllib.request.Request(
        address, data, {"Content-Type": "application/json"}, method=method
    )
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(request, timeout=60.0) as answer:
            return json.load(answer)["value"]
    except urllib.error.HTTPError as error:
        raise RuntimeError(json.load(error)["value"]["message"]) from None
