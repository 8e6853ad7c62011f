"""What stands before the application: who may ask, and how much they may send.

A page elsewhere can make a browser send requests to this machine. So a request must name this server
as its host, which a rebound name does not; what changes anything must come from this server's own page
and carry a header that other pages cannot set; and bodies are bounded in size, time and number.
"""

from __future__ import annotations

import asyncio
import secrets
from time import monotonic

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from orbiflow.studio.settings import LOOPBACK, Limits

SAFE = ("GET", "HEAD", "OPTIONS")
COOKIE = "orbiflow"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
SANDBOX = {"content-security-policy": "sandbox; default-src 'none'; style-src 'unsafe-inline'"}
"""What a file that was made may do where it is opened: nothing."""

PAGE = {
    "content-security-policy": "sandbox allow-scripts allow-downloads; default-src 'none'; "
    "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
}
"""What a page that was made may do: no more than on a disk, and nothing in the studio."""

HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
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
        request, begun = Request(scope), False

        async def guarded_send(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        try:
            self._check(request)
            if self.token and scope["path"] == "/" and "token" in request.query_params:
                # the address needs it no more
                answer: Response = RedirectResponse("/", 303)
                answer.set_cookie(COOKIE, self.token, httponly=True, samesite="strict")
                await answer(scope, receive, guarded_send)
            elif request.method in SAFE:
                await self.app(scope, receive, guarded_send)
            else:
                await self._with_body(request, receive, guarded_send)
        except Refused as refused:
            if not begun:
                said = {"error": refused.text}
                answer = JSONResponse(said, refused.status, {"connection": "close"})
                await answer(scope, receive, guarded_send)

    def _check(self, request: Request) -> None:
        headers = request.headers
        host = headers.get("host", "").lower()
        if not self.token and host not in self.hosts:
            raise Refused(421, "this is not the address of the studio; use the one that it printed")
        origin = headers.get("origin")
        is_elsewhere = origin is not None and origin.partition("://")[2] != host
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none") and not (
            request.scope["path"] == "/" and headers.get("sec-fetch-mode") == "navigate"
        ):
            is_elsewhere = True
        if is_elsewhere:
            raise Refused(403, "the request comes from another site's page; open the studio itself")
        if request.method not in SAFE and "x-orbiflow" not in headers:
            raise Refused(403, "a request that changes something needs the header X-Orbiflow: 1")
        brought = [
            headers.get("authorization", "").removeprefix("Bearer "),
            *request.query_params.getlist("token"),
            request.cookies.get(COOKIE, ""),
        ]
        token = self.token.encode()
        if token and not any(secrets.compare_digest(word.encode(), token) for word in brought):
            raise Refused(401, "open the address that the studio printed, with its token")

    async def _with_body(self, request: Request, receive: Receive, send: Send) -> None:
        headers, most = request.headers, self.limits.message
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
            await self.app(request.scope, body.receive, send)
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
