"""The web server: uvicorn, which ends streams before it stops, and hangs up on who says nothing."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from orbiflow.studio.guard import Guard
from orbiflow.studio.hub import Hub

PATIENCE = 20.0  # seconds in which the first request of a connection must have a whole head
CONNECTIONS = 400


class PatientProtocol(H11Protocol):
    """A connection that is closed if it opens and then sends no request."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Begin to wait."""
        super().connection_made(transport)
        self.loop.call_later(PATIENCE, self.hang_up)

    def hang_up(self) -> None:
        """Close the connection unless a request has come."""
        if self.cycle is None:
            self.transport.close()


class Server(uvicorn.Server):
    """A server whose streams end when it is told to stop; others it would wait for."""

    def __init__(self, config: uvicorn.Config, streams: Hub) -> None:
        super().__init__(config)
        self._streams = streams

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the streams, then everything else."""
        self._streams.close()
        await super().shutdown(sockets)


def serve(app: Guard, own: socket.socket) -> None:
    """Serve an application at a socket until the process is told to stop."""
    config = uvicorn.Config(
        app,
        http=PatientProtocol,
        log_level="warning",
        server_header=False,
        timeout_keep_alive=60,
        timeout_graceful_shutdown=2,
        limit_concurrency=CONNECTIONS,
    )
    state: Any = app.app
    Server(config, state.state.studio.hub).run(sockets=[own])
