"""Access to the page's server: for its own page, in a browser with the user's token.

The page's own files hold no user's data. Everything else goes to a browser that has posted the
token of the page's address, and got a cookie for it.
"""

from __future__ import annotations

import contextlib
import hmac
import time
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_NAMES = ("127.0.0.1", "localhost", "::1")
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


@dataclass(frozen=True, slots=True)
class Place:
    """The address of the page: on loopback, or elsewhere with a certificate."""

    host: str = "127.0.0.1"
    certificate: Path | None = None
    key: Path | None = None
    """The certificate's key, where the certificate does not hold it."""

    @property
    def scheme(self) -> str:
        """The scheme of the address."""
        return "http" if self.certificate is None else "https"


LOOPBACK = Place()


class Guard:
    """A guard against requests without a token, or of other pages; its headers confine our page."""

    def __init__(self, app: ASGIApp, place: Place, token: str, free: Collection[str]) -> None:
        """Guard `app`; `free` are the paths without a token."""
        self._app, self._place, self._token, self._free = app, place, token, free
        self._asking, self._asked = 0, time.monotonic()

    @property
    def silence(self) -> float:
        """Seconds since the last allowed request, or the end of the last open stream."""
        return 0.0 if self._asking else time.monotonic() - self._asked

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        request = Request(scope, receive)

        async def guarded(answer: Message) -> None:
            if answer["type"] == "http.response.start":
                added = [(k.lower().encode(), v.encode()) for k, v in _HEADERS.items()]
                answer = {**answer, "headers": [*answer.get("headers", ()), *added]}
            await send(answer)

        refusal = refused(request.headers, self._place)
        if refusal:
            await PlainTextResponse(f"{refusal}\n", 403)(scope, receive, guarded)
        elif (scope["method"], scope["path"]) == ("POST", "/enter"):
            await (await self._enter(request))(scope, receive, guarded)
        elif scope["path"] in self._free:
            await self._app(scope, receive, guarded)
        else:
            await self._tell(request, guarded)

    async def _enter(self, request: Request) -> Response:
        """Change the token for a cookie; a longer text is not read."""
        given = b""
        async for part in request.stream():
            given += part
            if len(given) > 1000:
                return PlainTextResponse("this is no token\n", 413)
        if not hmac.compare_digest(given, self._token.encode()):
            return PlainTextResponse("this is not the token of this user\n", 401)
        answer = Response(status_code=204)
        is_secure = self._place.certificate is not None
        name = _cookie(request)
        answer.set_cookie(name, self._token, httponly=True, samesite="strict", secure=is_secure)
        return answer

    async def _tell(self, request: Request, send: Send) -> None:
        given = request.cookies.get(_cookie(request), "")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            why = "the address of this page is the one that bt-actions view prints\n"
            await PlainTextResponse(why, 401)(request.scope, request.receive, send)
            return
        self._asking += 1
        try:
            await self._app(request.scope, request.receive, send)
        finally:
            self._asking -= 1
            self._asked = time.monotonic()


def _cookie(request: Request) -> str:
    """Return the name of the cookie, with the port in it: ports of one host share their cookies."""
    port = request.headers["host"].rpartition(":")[2]
    return f"bt_actions_{port if port.isdecimal() else ''}"


def refused(headers: Headers, place: Place = LOOPBACK) -> str:
    """Return why a request with these headers is refused; "" for an allowed one."""
    host = headers.get("host", "")
    names = _NAMES if place.certificate is None else (place.host,)
    if _name(f"//{host}") not in names:
        return f"this server answers to {' and '.join(names[:2])} alone"
    here = f"{place.scheme}://{host}"
    is_foreign = headers.get("sec-fetch-site") in ("cross-site", "same-site")
    if headers.get("origin", here) != here or is_foreign:
        return "this server answers its own page alone"
    return ""


def _name(address: str) -> str | None:
    with contextlib.suppress(ValueError):
        return urlsplit(address).hostname
    return None
