"""`bt-actions view`: the address that it prints, and what it says where there is no page."""

from __future__ import annotations

import http.client
import signal
import subprocess
import sys
import webbrowser
from urllib.parse import urlsplit

import pytest

from bt_actions.cli import main
from tests.cli.conftest import Start
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.recordings import record


def test_the_address_is_the_one_line_of_output_and_a_signal_ends_it(start: Start) -> None:
    first = record(every_kind())
    view = start("view", str(first))
    address = urlsplit(view.line())
    assert (address.hostname, address.fragment) == ("127.0.0.1", f"run={RUN_ID}")
    assert address.port is not None
    connection = http.client.HTTPConnection("127.0.0.1", address.port, timeout=20.0)
    connection.request("GET", f"/run/{RUN_ID}/events")
    assert connection.getresponse().status == 200
    view.popen.send_signal(signal.SIGINT)
    assert view.popen.wait(20.0) == 130


def test_open_shows_the_page_in_a_browser(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import uvicorn

    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open", shown.append)
    monkeypatch.setattr(uvicorn.Server, "run", lambda *_, **__: None)
    assert main(["view", "--open"]) == 0
    assert capsys.readouterr().out.split() == shown


def test_a_run_that_is_not_there_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "nowhere"]) == 2
    assert "no run is recorded yet" in capsys.readouterr().err


def test_a_port_that_is_taken_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    from bt_actions.page.server import listen

    with listen() as taken:
        port = taken.getsockname()[1]
        assert main(["view", "--port", str(port)]) == 2
    assert f"port {port} is taken: give another one with --port" in capsys.readouterr().err


@pytest.mark.parametrize("missing", ["starlette", "uvicorn"])
def test_without_its_packages_the_remedy_is_told(missing: str) -> None:
    program = (
        f"import sys; sys.modules[{missing!r}] = None\n"
        "from bt_actions.cli import main; sys.exit(main(['view']))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 2
    assert missing in done.stderr
    assert "pip install 'bt_actions[view]'" in done.stderr
    assert "Traceback" not in done.stderr
