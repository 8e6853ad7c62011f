"""What all routes share: the studio at hand, and the bodies of requests."""

from __future__ import annotations

import json
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from orbiflow.runtime import is_object
from orbiflow.studio.guard import Refused
from orbiflow.studio.hub import Hub
from orbiflow.studio.settings import Limits
from orbiflow.studio.store import UNDONE, Store
from orbiflow.studio.words import shown_task
from orbiflow.studio.work_queue import WorkQueue


@dataclass(frozen=True)
class Studio:
    """What routes work with."""

    store: Store
    queue: WorkQueue
    hub: Hub
    limits: Limits

    async def submit(
        self, project: str, operation: str, settings: dict[str, Any]
    ) -> dict[str, Any]:
        """Put a task into the queue and return it as the answer to who asked for it."""
        task = await self._submitted(project, operation, settings)
        return {"task": shown_task(self.store, self.store.task(task))}

    async def _submitted(self, project: str, operation: str, settings: dict[str, Any]) -> int:
        """Put a task into the queue, whose lock other requests need not wait for."""
        most = self.limits.waiting
        return await run_in_threadpool(self.queue.submit, project, operation, settings, most=most)

    async def done(self, project: str, operation: str, settings: dict[str, Any]) -> dict[str, Any]:
        """Put a task into the queue and return it once it has ended."""
        task = await self._submitted(project, operation, settings)
        changes = self.hub.changes(project)
        async for _ in changes:
            if self.store.task(task)["state"] not in UNDONE:
                break
        await changes.aclose()
        return self.store.task(task)


async def body_object(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request brings."""
    try:
        found = json.loads(await request.body() or b"{}")
    except (ValueError, RecursionError):
        raise Refused(400, "the request is no JSON; reload the page") from None
    if not is_object(found):
        raise Refused(400, "the request is no JSON object; reload the page")
    return found


async def save_body(request: Request, file: Path) -> None:
    """Write a request's body to a file, whole or not at all."""
    part = file.with_name(f".{file.name}.{secrets.token_hex(4)}.tmp")
    try:
        with part.open("xb") as out:
            async for chunk in request.stream():
                out.write(chunk)
        if not part.stat().st_size:
            raise Refused(422, "the file is empty; choose another one")
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)
