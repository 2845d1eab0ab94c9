"""The page's server: on loopback, for reading, and for browsers with the user's token alone.

A request names a run by the id of its recording: no text of a request is used as a path.
"""

from __future__ import annotations

import errno
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from bt_actions.page.feed import message, told
from bt_actions.page.front import standing
from bt_actions.page.guard import LOOPBACK, Guard, Place
from bt_actions.page.standing import token
from bt_actions.page.static_files import static_files
from bt_actions.recording.folders import Recorded, Summary, is_written, read_summary, recorded

PORT = 8650
"""The first port to try; as many more follow."""
PORTS = 50
_MOST = 64
"""Connections at a time; a browser has at most six."""
_BUFFER = 65_536
"""Bytes that the kernel holds for a browser that does not read."""
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}


class NoPort(OSError):
    """No free port among those that were tried."""


def listen(port: int | None = None, place: Place = LOOPBACK) -> socket.socket:
    """Return a socket: on `port`, or on the first free one from PORT on.

    Raises NoPort, and OSError for a host that is none of this computer.
    """
    ports = range(PORT, PORT + PORTS) if port is None else (port,)
    for each in ports:
        opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        try:
            opened.bind((place.host, each))
            opened.listen()
        except OSError as error:
            opened.close()
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise
        else:
            return opened
    tried = f"port {port} is" if port is not None else f"ports {PORT} to {PORT + PORTS - 1} are"
    raise NoPort(f"{tried} taken")


def address_of(opened: socket.socket, place: Place = LOOPBACK) -> str:
    """Return the address of the page."""
    return f"{place.scheme}://{place.host}:{opened.getsockname()[1]}/"


def id_of(given: Path) -> str:
    """Return the page's id of a run in any folder."""
    return next(_id(each) for each in _runs(given) if each.first == given)


def server_of(
    given: Path | None = None, place: Place = LOOPBACK, *, idle: float | None = None
) -> uvicorn.Server:
    """Return the page's server; `given` is a run in any folder.

    Its `run(sockets=[listen()])` returns at a signal, after `should_exit` is set, or after `idle`
    seconds without a request. Raises OSError.
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
        ssl_certfile=place.certificate,
        ssl_keyfile=place.key,
    )
    server = uvicorn.Server(config)
    app = _application(given, lambda: server.should_exit)
    config.app = guard = Guard(app, place, token(), {"/", *(f"/{name}" for name in static_files())})
    if idle is not None:
        threading.Thread(target=_end, args=(server, guard, idle), daemon=True).start()
    return server


def _end(server: uvicorn.Server, guard: Guard, idle: float) -> None:
    """End the server after so many seconds without a request."""
    while guard.silence < idle:
        time.sleep(idle / 100)
    server.should_exit = True


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

    def now(_: Request) -> Response:
        return StreamingResponse(standing(closing), media_type="text/event-stream")

    routes = [
        Route("/", page, methods=["GET"]),
        Route("/runs", runs, methods=["GET"]),
        Route("/run/{run}/events", events, methods=["GET"]),
        Route("/now", now, methods=["GET"]),
        Route("/{name}", page, methods=["GET"]),
    ]
    return Starlette(routes=routes)


async def _begun(stream: Any, known: str, after: int | None) -> Any:
    """Tell a browser first to forget its events, where they cannot be continued."""
    if known and after is None:
        yield message("reset", {})
    try:
        async for each in stream:
            yield each
    except (OSError, ValueError) as error:
        yield message("broken", {"why": str(error)})


def _number(known: str, run_id: str) -> int | None:
    """Return the number in ``RUN:NUMBER``, of this run; None without one."""
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


def _not_found(why: str) -> Response:
    return PlainTextResponse(f"{why}\n", 404)
