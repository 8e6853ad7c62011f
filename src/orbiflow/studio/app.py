"""The web application and its server: pages, facts about the studio, and errors in words."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles
from uvicorn.protocols.http.h11_impl import H11Protocol

from orbiflow import __version__
from orbiflow.drawing import PALETTES, Palette
from orbiflow.errors import OrbiflowError, advice_of
from orbiflow.runtime import find
from orbiflow.settings import MissingExtraError
from orbiflow.studio import (
    density_routes,
    mask_routes,
    offers,
    profile_routes,
    project_routes,
    shape_routes,
    solid_routes,
)
from orbiflow.studio.guard import Guard, Refused
from orbiflow.studio.hub import Hub
from orbiflow.studio.kinds_of_work import KINDS, RefusedSetting, kind_of_work, own_schema, presets
from orbiflow.studio.project_routes import ANIMALS, animal_file
from orbiflow.studio.routes import Routes, Studio
from orbiflow.studio.settings import Limits
from orbiflow.studio.store import Missing, Store
from orbiflow.studio.words import page_words
from orbiflow.studio.work_queue import WorkQueue

STATIC = Path(__file__).parent / "static"
SCRIPTS = Path(__file__).parents[1] / "drawing" / "js"
"""Scripts that pages of their own carry, too."""

TURNED = {
    "surface": SCRIPTS.parents[1] / "density" / "pictures" / "surface.js",
    "stack": SCRIPTS.parents[1] / "solids" / "stack.js",
}
"""Scripts that come after `turned.js`."""

SETTLE_SECONDS = 20.0  # seconds
MAX_PIXELS = 128_000_000  # of a picture that is read
MAX_SHADES = 8  # of the colour of one of two figures
log = logging.getLogger("orbiflow.studio")


def create_app(
    store: Store,
    queue: WorkQueue,
    limits: Limits | None = None,
    *,
    port: int = 8437,
    token: str = "",
) -> Guard:
    """Return the application as a server runs it, behind its guard.

    Args:
        store: Where projects are kept.
        queue: What does their work; it begins and ends with the application.
        limits: What is taken at most.
        port: The port by which browsers know the server.
        token: What clients must bring, where others than this machine may reach the server.
    """
    limits = limits or Limits()
    hub = Hub(store)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        hub.open(asyncio.get_running_loop())
        for kind in KINDS.values():  # no request waits for imports
            with suppress(MissingExtraError):
                find(kind.work)
                find(kind.makes or kind.work)
        queue.start()
        settling = asyncio.create_task(_settle(store))
        yield
        settling.cancel()
        hub.close()
        await asyncio.to_thread(queue.close)
        store.close()

    topics = (
        density_routes,
        solid_routes,
        project_routes,
        mask_routes,
        offers,
        profile_routes,
        shape_routes,
    )
    every = [*routes, *(route for topic in topics for route in topic.routes)]
    pages, scripts = (
        GZipMiddleware(
            StaticFiles(directory=folder, html=folder is STATIC)
        )  # a third of their size
        for folder in (STATIC, SCRIPTS)
    )
    kinds = (Refused, OrbiflowError, HTTPException, Exception)
    app = Starlette(
        routes=[Mount("/api", routes=every), Mount("/drawing/js", scripts), Mount("/", pages)],
        exception_handlers=dict.fromkeys(kinds, _error_answer),
        lifespan=lifespan,
    )
    app.state.studio = Studio(store, queue, hub, limits)
    return Guard(app, limits, port=port, token=token)


async def _settle(store: Store) -> None:
    """Let the store settle now and then."""
    while True:
        await asyncio.sleep(SETTLE_SECONDS)
        await asyncio.to_thread(store.settle)


routes = Routes()


@routes("GET", "/about")
async def about(here: Studio) -> dict[str, Any]:
    """Return what the pages need to know of the studio."""
    limits = here.limits
    return {
        "version": __version__,
        "limits": {"bytes": limits.upload, "pixels": MAX_PIXELS, "projects": limits.projects},
        "animals": [
            {"name": name, "title": title, "picture": f"/api/animals/{animal_file(name).name}"}
            for name, title in ANIMALS.items()
        ],
        "palettes": [
            {"name": name, **palette._asdict(), "shades": _shades(palette)}
            for name, palette in PALETTES.items()
        ],
        "efforts": ["fast", "normal"],
    }


def _shades(palette: Palette) -> list[list[tuple[str, ...]]]:
    """Return, for each of two figures, its colours if it has 1, 2, 3 ... of them."""
    every = [palette.shaded((count, count)).colours for count in range(1, MAX_SHADES + 1)]
    return [[both[: len(both) // 2] for both in every], [both[len(both) // 2 :] for both in every]]


@routes("GET", "/animals/{file}")
async def animal(file: str) -> FileResponse:
    """Return the picture of an animal."""
    return FileResponse(animal_file(file.partition(".")[0]))


@routes("GET", "/operations/{name}/schema")
async def schema(name: str) -> dict[str, Any]:
    """Return the settings of a task."""
    kind = kind_of_work(name)
    document = own_schema(find(kind.makes or kind.work))
    return {**document, "x-presets": presets(kind.makes) if kind.makes else {}}


async def _error_answer(_request: Request, error: Exception) -> JSONResponse:
    """Answer what went wrong in words, without paths or insides."""
    if isinstance(error, Refused):
        return JSONResponse({"error": error.text}, error.status)
    if isinstance(error, OrbiflowError):
        about = {"setting": error.setting} if isinstance(error, RefusedSetting) else {}
        status = 404 if isinstance(error, Missing) else 422
        return JSONResponse({"error": page_words(advice_of(error)), **about}, status)
    if isinstance(error, HTTPException):
        words = {404: "there is nothing here; go back to the start page"}
        text = words.get(error.status_code, "this request cannot be answered; reload the page")
        return JSONResponse({"error": text}, error.status_code)
    log.error("a request failed", exc_info=error)
    return JSONResponse({"error": "something went wrong in the studio; reload the page"}, 500)


@routes("GET", "/scripts/{name}.js")
def script(name: str) -> Response:
    """Serve a script of what is turned by hand, here and in pages of its own, as one module."""
    if name not in TURNED:
        raise Refused(404, "there is no such script; reload the page")
    text = "\n".join(file.read_text("utf-8") for file in (SCRIPTS / "turned.js", TURNED[name]))
    return Response(text, media_type="text/javascript")


MAX_HEAD_SECONDS = 20.0  # seconds in which the first request of a connection must have a whole head
MAX_CONNECTIONS = 400


class PatientProtocol(H11Protocol):
    """A connection that is closed if it opens and then sends no request."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Begin to wait."""
        super().connection_made(transport)
        self.loop.call_later(MAX_HEAD_SECONDS, self.hang_up)

    def hang_up(self) -> None:
        """Close the connection unless a request has come."""
        if self.cycle is None:
            self.transport.close()


class Server(uvicorn.Server):
    """A server that ends its streams when it stops; uvicorn's own would wait for them."""

    def __init__(self, config: uvicorn.Config, streams: Hub) -> None:
        super().__init__(config)
        self._streams = streams

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the streams, then everything else."""
        self._streams.close()
        await super().shutdown(sockets)


def serve(app: Guard, listener: socket.socket) -> None:
    """Serve an application at a socket until the process is stopped."""
    config = uvicorn.Config(
        app,
        http=PatientProtocol,
        log_level="warning",
        server_header=False,
        timeout_keep_alive=60,
        timeout_graceful_shutdown=2,
        limit_concurrency=MAX_CONNECTIONS,
    )
    state: Any = app.app
    Server(config, state.state.studio.hub).run(sockets=[listener])
