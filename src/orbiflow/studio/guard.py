"""What stands before the application: who may ask, and how much they may send.

A page elsewhere can make a browser send requests to this machine. So a request must name this server
as its host, which a rebound name does not; what changes anything must come from this server's own page
and carry a header that other pages cannot set; and bodies are bounded in size, time and number.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from time import monotonic
from urllib.parse import parse_qs

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from orbiflow.studio.settings import LOOPBACK, Limits

SAFE = ("GET", "HEAD", "OPTIONS")
COOKIE = "orbiflow"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(self), microphone=(), geolocation=()",
    "cache-control": "no-cache",
}


class Refused(Exception):
    """A request that is not answered; the status, and what to do in words."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


class Guard:
    """The application behind all checks.

    Args:
        app: The application.
        limits: What bodies may have.
        port: The server's own port.
        token: What everybody must bring, if anything; then any host may be named.
    """

    def __init__(self, app: ASGIApp, limits: Limits, *, port: int, token: str = "") -> None:
        self.app, self.limits, self.token = app, limits, token
        names = [f"[{name}]" if ":" in name else name for name in LOOPBACK]
        self.hosts = {f"{name}:{port}" for name in names}
        if port == 80:
            self.hosts |= set(names)
        self._uploads = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.app(scope, receive, send)
            return
        headers = {
            name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]
        }
        begun = False

        async def guarded_send(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                message["headers"] = [*_added(message["headers"]), *message["headers"]]
            await send(message)

        try:
            self._check(scope, headers)
            if (cookie := self._welcome(scope)) is not None:
                await _answer(guarded_send, 303, "", [("location", "/"), ("set-cookie", cookie)])
                return
            await self._with_body(scope, headers, receive, guarded_send)
        except Refused as refused:
            if not begun:
                await _answer(guarded_send, refused.status, refused.text, [("connection", "close")])

    def _check(self, scope: Scope, headers: dict[str, str]) -> None:
        host = headers.get("host", "").lower()
        if not self.token and host not in self.hosts:
            raise Refused(421, "this is not the address of the studio; use the one that it printed")
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != host:
            raise Refused(403, "the request comes from another site's page; open the studio itself")
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none") and not (
            scope["path"] == "/" and headers.get("sec-fetch-mode") == "navigate"
        ):
            raise Refused(403, "the request comes from another site's page; open the studio itself")
        if scope["method"] not in SAFE and "x-orbiflow" not in headers:
            raise Refused(403, "a request that changes something needs the header X-Orbiflow: 1")
        if self.token and not self._knows_token(scope, headers):
            raise Refused(401, "open the address that the studio printed, with its token")

    def _knows_token(self, scope: Scope, headers: dict[str, str]) -> bool:
        brought = [headers.get("authorization", "").removeprefix("Bearer ")]
        brought += parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            cookies = SimpleCookie()
        brought += [cookies[COOKIE].value] if COOKIE in cookies else []
        return any(secrets.compare_digest(one.encode(), self.token.encode()) for one in brought)

    def _welcome(self, scope: Scope) -> str | None:
        """Return the cookie for who came with the token in the address, which then leaves it."""
        if not self.token or scope["path"] != "/" or b"token=" not in scope["query_string"]:
            return None
        return f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    async def _with_body(
        self, scope: Scope, headers: dict[str, str], receive: Receive, send: Send
    ) -> None:
        if scope["method"] in SAFE:
            await self.app(scope, receive, send)
            return
        most = self.limits.message
        if headers.get("content-type", "").split(";")[0] != "application/json":
            most = self.limits.upload
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > most:
            raise Refused(413, f"this is too large: at most {most / 2**20:.0f} MB are taken")
        if self._uploads >= self.limits.uploads:
            raise Refused(503, "too much is being sent at once; try again in a moment")
        self._uploads += 1
        body = _Body(receive, self.limits, most)
        try:
            await self.app(scope, body.receive, send)
        finally:
            self._uploads -= 1


class _Body:
    """A body as it comes, up to a size and no slower than allowed."""

    def __init__(self, receive: Receive, limits: Limits, most: int) -> None:
        self._receive, self._limits, self._most = receive, limits, most
        self._size, self._whole, self._waited = 0, False, 0.0

    async def receive(self) -> Message:
        """Return the next part."""
        if self._whole:  # the application waits for the client to leave
            return await self._receive()
        begin = monotonic()
        try:
            async with asyncio.timeout(self._limits.seconds):
                message = await self._receive()
        except TimeoutError:
            raise Refused(408, "the file did not come in time; try again") from None
        self._waited += monotonic() - begin
        self._size += len(message.get("body", b""))
        self._whole = not message.get("more_body", False)
        if self._size > self._most:
            text = f"this is too large: at most {self._most / 2**20:.0f} MB are taken"
            raise Refused(413, text)
        late = self._waited - self._limits.seconds
        if late > 0 and self._size < late * self._limits.slowest:
            raise Refused(408, "the file comes too slowly; try again")
        return message


def _added(headers: Iterable[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    own = {name.lower() for name, _ in headers}
    return [
        (name.encode(), value.encode())
        for name, value in HEADERS.items()
        if name.encode() not in own
    ]


async def _answer(send: Send, status: int, text: str, headers: list[tuple[str, str]]) -> None:
    body = json.dumps({"error": text}).encode()
    own = [("content-type", "application/json"), ("content-length", str(len(body))), *headers]
    raw = [(name.encode(), value.encode()) for name, value in own]
    await send({"type": "http.response.start", "status": status, "headers": raw})
    await send({"type": "http.response.body", "body": body})
