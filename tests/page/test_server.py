"""What the page's server answers, and to whom."""

from __future__ import annotations

import http.client
import json
import re
from pathlib import Path

import pytest

from bt_actions.page import server
from tests.page.conftest import Served
from tests.support.every_kind import RUN_ID, every_kind
from tests.support.recordings import record

STATIC = Path(server.__file__).parent / "static"


def ask(served: Served, path: str, method: str = "GET", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=20.0)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, headers=given)
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
    assert ask(served, "/runs", Host=host).status == 200


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
