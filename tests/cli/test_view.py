"""`bt-actions view`: the address that it prints, and what it says where there is no page."""

from __future__ import annotations

import http.client
import os
import signal
import subprocess
import sys
import webbrowser
from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

import pytest

from bt_actions.cli import main
from bt_actions.cli.commands.view import NICE
from bt_actions.events import RunBegan
from tests.cli.conftest import Start
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.processes import ROOT
from tests.support.recordings import record


def test_the_address_is_the_one_line_of_output_and_a_signal_ends_it(start: Start) -> None:
    first = record(every_kind())
    view = start("view", str(first))
    address = urlsplit(view.line())
    shown = dict(parse_qsl(address.fragment))
    assert (address.hostname, shown["run"]) == ("127.0.0.1", RUN_ID)
    assert address.port is not None
    connection = http.client.HTTPConnection("127.0.0.1", address.port, timeout=20.0)
    cookie = {"Cookie": f"bt_actions_{address.port}={shown['token']}"}
    connection.request("GET", f"/run/{RUN_ID}/events", headers=cookie)
    assert connection.getresponse().status == 200
    assert os.getpriority(os.PRIO_PROCESS, view.popen.pid) == NICE, "the ticks of a run come first"
    view.popen.send_signal(signal.SIGINT)
    assert view.popen.wait(20.0) == 130


def test_open_shows_the_page_in_a_browser(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import uvicorn

    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open", shown.append)
    monkeypatch.setattr(uvicorn.Server, "run", lambda *_, **__: None)
    monkeypatch.setattr(os, "nice", lambda _: 0)
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


def test_the_demo_ends_with_the_command_that_shows_its_run(
    capsys: pytest.CaptureFixture[str],
) -> None:
    events = [
        replace(each, tree="pick_and_place") if isinstance(each, RunBegan) else each
        for each in every_kind()
    ]
    record(events)
    path = Path(sys.executable).parent
    shown = subprocess.run(
        ["make", "--no-print-directory", "--dry-run", "--old-file=setup", "demo", f"BIN={path}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    demo, hint = shown.stdout.splitlines()
    assert "--sim --speed 10" in demo
    said = subprocess.run(hint, shell=True, capture_output=True, text=True, check=True).stdout
    assert said == f"look at it: {path}/bt-actions view {RUN_ID[:4]}\n"
    assert main(["report", said.split()[-1]]) == 0
    assert "pick_and_place" in capsys.readouterr().out


# Beside a command


@pytest.mark.ros
def test_run_and_serve_print_the_address_of_the_view_that_is_running(start: Start) -> None:
    view = start("view")
    address, _, token = view.line().partition("#")
    for command, shown in (
        ("run trees/pick_and_place.yaml --sim --speed 50", ""),
        ("serve --trees nowhere", "&runs"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "bt_actions.cli", *command.split(), "--view"],
            capture_output=True,
            text=True,
            timeout=60.0,
        )
        assert done.stderr.splitlines()[0] == f"look at it: {address}#{token}{shown}"
        assert address not in done.stdout
    assert view.popen.poll() is None


@pytest.mark.parametrize("option", ["--no-record", "--record=monday.mcap"])
def test_what_no_page_could_show_is_refused(
    option: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["run", "trees/pick_and_place.yaml", "--sim", "--view", option]) == 2
    monkeypatch.setenv("BT_ACTIONS_RECORD", "off")
    assert main(["run", "trees/pick_and_place.yaml", "--sim", "--view"]) == 2
    told = capsys.readouterr().err
    assert told.count("--view shows a recording in the usual folder") == 2


@pytest.mark.parametrize("options", ["--host 127.0.0.1", "--certificate x.pem"])
def test_the_page_leaves_the_computer_with_a_certificate_only(
    options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", *options.split()]) == 2
    assert "--host and --certificate go together" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options", ["--host localhost --certificate nowhere.pem", "--host 192.0.2.1 --certificate x"]
)
def test_a_page_that_cannot_be_served_is_told(
    options: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", *options.split()]) == 2
    assert "the page cannot be served" in capsys.readouterr().err
