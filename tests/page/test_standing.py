"""The view that is running, for commands that show what they do; and how long it runs."""

from __future__ import annotations

import contextlib
import os
import signal
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from shutil import which

import pytest

from bt_actions.page import standing
from bt_actions.page.guard import Place
from bt_actions.recording.folders import home
from tests.page.conftest import Begin, Served
from tests.page.test_server import ask
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.recordings import record
from tests.support.waiting import holds_for, until


def test_a_view_is_known_while_it_runs() -> None:
    assert standing.running() == ""
    with standing.registered("http://127.0.0.1:1/"):
        assert standing.running() == "http://127.0.0.1:1/"
        with standing.registered("http://127.0.0.1:2/"):  # is used by whoever started it
            assert standing.running() == "http://127.0.0.1:1/"
    assert standing.running() == ""


def test_a_view_whose_process_was_killed_is_not_used() -> None:
    program = (
        "from bt_actions.page import standing\n"
        "with standing.registered('http://127.0.0.1:1/'):\n    print('up', flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as killed:
        assert killed.stdout is not None
        assert killed.stdout.readline() == b"up\n"
        assert standing.running()
        killed.kill()
    assert standing.running() == ""
    with standing.registered("http://127.0.0.1:2/"):
        assert standing.running() == "http://127.0.0.1:2/"


@pytest.fixture
def mark(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """End the views that a test has started."""
    monkeypatch.setenv("BT_ACTIONS_TEST_MARK", mark := f"view-{os.getpid()}-{time.monotonic()}")
    yield
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if int(entry.name) != os.getpid() and mark.encode() in (entry / "environ").read_bytes():
                os.kill(int(entry.name), signal.SIGTERM)


@pytest.mark.usefixtures("mark")
def test_where_none_runs_one_is_started_and_used_by_all() -> None:
    found: list[str] = []
    asking = [threading.Thread(target=lambda: found.append(standing.shown())) for _ in range(3)]
    for each in asking:
        each.start()
    for each in asking:
        each.join()
    used = standing.running()
    assert used in found
    assert standing.shown() == used
    assert standing.opening(used, "runs") == f"{used}#token={standing.token()}&runs"


def test_a_view_that_cannot_be_started_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    home().parent.mkdir(parents=True)
    (home().parent / "view.token").mkdir()  # so none can be read
    with pytest.raises(standing.NoView, match=r"Is a directory.*view\.token"):
        standing.shown()


def test_a_view_ends_when_nobody_has_asked_for_long_but_not_while_a_tab_is_open(
    begin: Begin,
) -> None:
    begin(every_kind()).write(every_kind()[:6])
    served = Served(idle=0.5)
    stream = ask(served, f"/run/{RUN_ID}/events")
    assert holds_for(lambda: served.runs, 1.5)
    stream.close()
    until(lambda: not served.runs)


# Beyond this computer


@pytest.fixture
def certificate(tmp_path: Path) -> Path:
    if which("openssl") is None:
        pytest.skip("openssl makes the certificate")
    path, key = tmp_path / "robot.pem", tmp_path / "key.pem"
    wish = (
        "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost"
    )
    wish += f" -addext subjectAltName=DNS:localhost -keyout {key} -out {path}"
    subprocess.run(["openssl", *wish.split()], check=True, capture_output=True)
    path.write_text(path.read_text() + key.read_text())
    return path


def test_with_a_certificate_the_page_is_served_by_tls_to_the_name_that_was_given(
    certificate: Path,
) -> None:
    record(every_kind())
    served = Served(place=Place("localhost", certificate))
    try:
        known = ssl.create_default_context(cafile=str(certificate))
        assert ask(served, "/", known=known).status == 200
        entered = ask(served, "/enter", "POST", served.token.encode(), known=known, Cookie="")
        assert "Secure" in entered.headers["Set-Cookie"]
        assert RUN_ID in ask(served, "/runs", known=known).read().decode()
        assert ask(served, "/runs", known=known, Cookie="").status == 401
        assert ask(served, "/runs", known=known, Host="127.0.0.1").status == 403
        foreign = f"http://localhost:{served.port}"
        assert ask(served, "/runs", known=known, Origin=foreign).status == 403
    finally:
        served.stop()
