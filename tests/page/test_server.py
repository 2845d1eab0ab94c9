"""What the page's server answers, and to whom."""

from __future__ import annotations

import http.client
import json
import re
import ssl
from pathlib import Path

import pytest

from bt_actions.page import server
from bt_actions.recording.folders import home
from tests.page.conftest import Served
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.recordings import record

STATIC = Path(server.__file__).parent / "static"


def ask(
    served: Served,
    path: str,
    method: str = "GET",
    body: bytes = b"",
    known: ssl.SSLContext | None = None,
    **headers: str,
) -> http.client.HTTPResponse:
    """Ask as a page that has the cookie of its server, unless the headers say otherwise.

    With `known` certificates, by TLS.
    """
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=20.0)
    if known is not None:
        connection = http.client.HTTPSConnection("localhost", served.port, context=known)
    given = {"Cookie": served.cookie, **headers}
    given = {name.replace("_", "-"): value for name, value in given.items()}
    connection.request(method, path, body or None, headers=given)
    return connection.getresponse()


def test_the_page_and_its_modules_are_served_with_a_policy_that_allows_these_alone(
    served: Served,
) -> None:
    for path in ["/", *(f"/{each.name}" for each in STATIC.iterdir())]:
        answer = ask(served, path)
        assert answer.status == 200
        policy = answer.headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
        assert "unsafe" not in policy
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        kind = {"css": "text/css", "js": "text/javascript"}.get(path.rpartition(".")[2])
        assert answer.headers.get_content_type() == (kind or "text/html")


def test_the_modules_are_short_and_name_no_other_host() -> None:
    for module in STATIC.glob("*.js"):
        text = module.read_text()
        assert text.count("\n") <= 300
        assert set(re.findall(r"[a-z]+://[^\"' ]+", text)) <= {"http://www.w3.org/2000/svg"}


@pytest.mark.parametrize("host", ["localhost:9000", "127.0.0.1", "[::1]:8650"])
def test_a_loopback_name_is_answered_whatever_the_port_that_a_tunnel_has(
    served: Served, host: str
) -> None:
    port = host.rpartition(":")[2]
    cookie = served.cookie.replace(f"{served.port}", port if port.isdecimal() else "")
    assert ask(served, "/runs", Host=host, Cookie=cookie).status == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example:8650"},
        {"Host": "localhost@evil.example"},
        {"Host": ""},
        {"Host": "[::1"},
        {"Host": "127.0.0.1", "Origin": "http://evil.example"},
        {"Host": "127.0.0.1:8650", "Origin": "http://127.0.0.1:3000"},
        {"Host": "127.0.0.1", "Origin": "null"},
        {"Host": "127.0.0.1", "Sec_Fetch_Site": "cross-site"},
        {"Host": "127.0.0.1", "Sec_Fetch_Site": "same-site"},
    ],
)
@pytest.mark.parametrize("path", ["/", "/runs", f"/run/{RUN_ID}/events"])
def test_a_page_of_another_host_learns_nothing(
    served: Served, path: str, headers: dict[str, str]
) -> None:
    record(every_kind())
    answer = ask(served, path, **headers)
    assert answer.status == 403
    assert RUN_ID not in answer.read().decode()


def test_the_token_is_changed_for_a_cookie_that_no_script_and_no_other_page_has(
    served: Served,
) -> None:
    answer = ask(served, "/enter", "POST", served.token.encode(), Cookie="")
    assert answer.status == 204
    cookie, *rules = answer.headers["Set-Cookie"].split("; ")
    assert cookie == served.cookie
    assert {"HttpOnly", "SameSite=strict"} <= set(rules)
    assert ask(served, "/runs", Cookie=cookie).status == 200


@pytest.mark.parametrize(
    "cookie", ["", "bt_actions_PORT=", "bt_actions_PORT=wrong", "bt_actions_1=TOKEN", "TOKEN"]
)
@pytest.mark.parametrize("path", ["/runs", f"/run/{RUN_ID}/events", "/run/x/events", "/else"])
def test_without_the_cookie_of_this_port_nothing_is_told(
    served: Served, path: str, cookie: str
) -> None:
    record(every_kind())
    cookie = cookie.replace("PORT", str(served.port)).replace("TOKEN", served.token)
    answer = ask(served, path, Cookie=cookie)
    assert answer.status == 401
    assert RUN_ID not in answer.read().decode()


@pytest.mark.parametrize("token", ["", "wrong", "TOKEN TOKEN", "\xff"])
def test_a_wrong_token_gets_no_cookie(served: Served, token: str) -> None:
    given = token.replace("TOKEN", served.token).encode("latin-1")
    answer = ask(served, "/enter", "POST", given, Cookie="")
    assert answer.status == 401
    assert "Set-Cookie" not in answer.headers


@pytest.mark.parametrize(("path", "status"), [("/enter", 413), ("/runs", 405), ("/", 405)])
def test_a_long_body_is_answered_before_it_has_come(served: Served, path: str, status: int) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=20.0)
    connection.putrequest("POST", path)
    connection.putheader("Cookie", served.cookie)
    connection.putheader("Content-Length", "10000000")
    connection.endheaders(b"x" * 2000)
    assert connection.getresponse().status == status
    assert ask(served, "/runs").status == 200


def test_the_token_is_the_users_own_file_and_the_same_after_a_restart(served: Served) -> None:
    file = home().parent / "view.token"
    assert file.stat().st_mode & 0o777 == 0o600
    assert (file.read_text(), len(served.token)) == (served.token, 32)
    before = served.cookie
    served.stop()
    served.start()
    assert ask(served, "/runs", Cookie=before).status == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_changed(served: Served, method: str) -> None:
    record(every_kind())
    for path in ("/", "/runs", f"/run/{RUN_ID}/events"):
        assert ask(served, path, method).status == 405


@pytest.mark.parametrize(
    "path",
    [
        "/../server.py",
        "/..%2fserver.py",
        "/%2e%2e/%2e%2e/setup.cfg",
        "//etc/passwd",
        "/server.py",
        "/run/../../etc/passwd/events",
        "/run/..%2f..%2frun/events",
        "/run//events",
        "/run/%00/events",
        f"/run/{RUN_ID[:8]}/events",
        f"/run/20270115T080000-all-{RUN_ID[:8]}/events",
    ],
)
def test_a_path_leads_nowhere(served: Served, path: str) -> None:
    record(every_kind())
    assert ask(served, path).status == 404


def test_the_runs_are_listed(served: Served) -> None:
    assert json.load(ask(served, "/runs")) == {"runs": []}
    record(every_kind())
    (run,) = json.load(ask(served, "/runs"))["runs"]
    assert (run["run_id"], run["tree"], run["written"]) == (RUN_ID, "all", False)
    assert run["stopped_by"] == "SIGINT"


def test_the_next_port_is_taken_where_one_is_not_free() -> None:
    with server.listen() as first, server.listen() as second:
        assert server.PORT <= first.getsockname()[1] < second.getsockname()[1]
        with pytest.raises(server.NoPort, match="taken"):
            server.listen(first.getsockname()[1])
