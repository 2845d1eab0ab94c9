"""The page's server: loopback only, reads only, and answers nobody's page but its own.

Runs are known by the ids of the recordings that there are: no text of a request is used as a path.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bt_actions.page.feed import message, told
from bt_actions.page.static_files import static_files
from bt_actions.recording.folders import Recorded, Summary, is_written, read_summary, recorded

PORT = 8650
"""The first port that is tried, and this many after it."""
PORTS = 50
_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_MOST = 64
"""Connections at a time; a browser has six of them at most."""
_BUFFER = 65_536
"""Bytes that the kernel holds for a browser which does not read."""
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; require-trusted-types-for 'script'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class NoPort(OSError):
    """No port of those that were tried is free."""


def listen(port: int | None = None) -> socket.socket:
    """Return a socket on loopback: on `port`, or on the first free one from PORT on.

    Raises NoPort.
    """
    ports = range(PORT, PORT + PORTS) if port is None else (port,)
    for each in ports:
        opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        try:
            opened.bind(("127.0.0.1", each))
            opened.listen()
        except OSError:
            opened.close()
        else:
            return opened
    tried = f"port {port} is" if port is not None else f"ports {PORT} to {PORT + PORTS - 1} are"
    raise NoPort(f"{tried} taken")


def address(opened: socket.socket, given: Path | None = None) -> str:
    """Return where the page is, of a run that is given or of whatever the page finds."""
    place = f"http://127.0.0.1:{opened.getsockname()[1]}/"
    runs = [] if given is None else [each for each in _runs(given) if each.first == given]
    return f"{place}#run={_id(runs[0])}" if runs else place


def server_of(given: Path | None = None) -> uvicorn.Server:
    """Return the page's server; `given` is a run that may lie anywhere.

    Its `run(sockets=[listen()])` returns when a signal comes, or after `should_exit` is set.
    """
    config = uvicorn.Config(
        "",
        log_level="critical",
        access_log=False,
        lifespan="off",
        http="h11",
        ws="none",
        loop="asyncio",
        server_header=False,
        date_header=False,
        limit_concurrency=_MOST,
        timeout_graceful_shutdown=1,
    )
    server = uvicorn.Server(config)
    config.app = _application(given, lambda: server.should_exit)
    return server


def _application(given: Path | None, closing: Callable[[], bool]) -> ASGIApp:
    static = {name: text.encode() for name, text in static_files().items()}

    def page(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        kind = _TYPES.get(name.rpartition(".")[2])
        if name not in static or kind is None:
            return _not_found(f"no file {name!r}")
        return Response(static[name], media_type=kind)

    def runs(_: Request) -> Response:
        return JSONResponse({"runs": [_told(each) for each in _runs(given)]})

    async def events(request: Request) -> Response:
        run = next((each for each in _runs(given) if _id(each) == request.path_params["run"]), None)
        if run is None:
            return _not_found("no such run")
        known = request.headers.get("last-event-id") or request.query_params.get("after", "")
        after = _number(known, _id(run))
        stream = told(run.first, _id(run), after or 0, closing)
        return StreamingResponse(_begun(stream, known, after), media_type="text/event-stream")

    routes = [
        Route("/", page, methods=["GET"]),
        Route("/runs", runs, methods=["GET"]),
        Route("/run/{run}/events", events, methods=["GET"]),
        Route("/{name}", page, methods=["GET"]),
    ]
    return _Guard(Starlette(routes=routes))


async def _begun(stream: Any, known: str, after: int | None) -> Any:
    """Tell a browser first to forget what it has where that cannot be gone on with."""
    if known and after is None:
        yield message("reset", {})
    try:
        async for each in stream:
            yield each
    except (OSError, ValueError) as error:
        yield message("broken", {"why": str(error)})


def _number(known: str, run_id: str) -> int | None:
    """The number in ``RUN:NUMBER``, of this run; None where none is told."""
    run, _, number = known.rpartition(":")
    return int(number) if run == run_id and number.isascii() and number.isdecimal() else None


# Runs


def _runs(given: Path | None) -> list[Recorded]:
    found = recorded()
    if given is not None and all(each.first != given for each in found):
        summary = read_summary(given) or Summary("given", given.stem, given.stat().st_mtime)
        found.insert(0, Recorded(given, summary, is_written(given)))
    return found


def _id(run: Recorded) -> str:
    return run.summary.run_id


def _told(run: Recorded) -> dict[str, Any]:
    return {**asdict(run.summary), "written": run.is_written, "failed": run.summary.failed}


# Who may ask


class _Guard:
    """Refuses what does not come from a page of this server, and adds what keeps that page in."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        headers = Headers(scope=scope)

        async def guarded(answer: Message) -> None:
            if answer["type"] == "http.response.start":
                added = [(k.lower().encode(), v.encode()) for k, v in _HEADERS.items()]
                answer = {**answer, "headers": [*answer.get("headers", ()), *added]}
            await send(answer)

        refusal = refused(headers)
        if refusal:
            await PlainTextResponse(f"{refusal}\n", 403)(scope, receive, guarded)
        else:
            await self._app(scope, receive, guarded)


def refused(headers: Headers) -> str:
    """Say why a request with these headers is refused; "" where it is not."""
    host = headers.get("host", "")
    if _name(f"//{host}") not in _LOOPBACK:
        return "this server answers to 127.0.0.1 and localhost alone"
    origin = headers.get("origin", f"http://{host}")
    if origin != f"http://{host}" or headers.get("sec-fetch-site") in ("cross-site", "same-site"):
        return "this server answers its own page alone"
    return ""


def _name(address: str) -> str | None:
    with contextlib.suppress(ValueError):
        return urlsplit(address).hostname
    return None


def _not_found(why: str) -> Response:
    return PlainTextResponse(f"{why}\n", 404)
