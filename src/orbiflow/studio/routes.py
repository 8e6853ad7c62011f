"""Routes: what a browser asks for by an address, answered by a function of what the address names."""

from __future__ import annotations

import inspect
import json
import secrets
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from orbiflow.runtime import is_object
from orbiflow.studio.brought_files import ENDINGS
from orbiflow.studio.guard import Refused
from orbiflow.studio.hub import Hub
from orbiflow.studio.settings import Limits
from orbiflow.studio.store import UNDONE, Store
from orbiflow.studio.words import NAMES, shown_task
from orbiflow.studio.work_queue import WorkQueue

Answer = TypeVar("Answer", bound=Callable[..., Any])


class Routes(list[Route]):
    """Routes of one topic; called with a method and an address, it decorates a function that answers.

    The function is given what it names: a `Request`, its `JsonObject`, the `Studio`, parts of the
    address in braces, and what comes after its question mark, as texts or whole numbers. It returns a
    response, or what JSON has.
    """

    def __call__(self, method: str, path: str) -> Callable[[Answer], Answer]:
        """Return the decorator that adds a route."""

        def add(answer: Answer) -> Answer:
            self.append(Route(path, _endpoint(answer), methods=[method]))
            return answer

        return add


class JsonObject(dict[str, Any]):
    """The JSON object that a request brings."""


def _endpoint(answer: Callable[..., Any]) -> Callable[[Request], Any]:
    """Return a function that gives another what it names of a request."""
    kinds = get_type_hints(answer)
    kinds.pop("return", None)
    defaults = {
        name: parameter.default
        for name, parameter in inspect.signature(answer).parameters.items()
        if parameter.default is not parameter.empty
    }

    async def endpoint(request: Request) -> Response:
        named = {**defaults, **request.query_params, **request.path_params}
        if JsonObject in kinds.values():
            named["body"] = await _body(request)
        arguments = {name: _value(kind, name, named, request) for name, kind in kinds.items()}
        if inspect.iscoroutinefunction(answer):
            reply = await answer(**arguments)
        else:
            reply = await run_in_threadpool(answer, **arguments)
        return reply if isinstance(reply, Response) else JSONResponse(reply)

    return endpoint


def _value(kind: type, name: str, named: Mapping[str, Any], request: Request) -> Any:
    """Return what a parameter of this type and name is given."""
    if kind is Request:
        return request
    if kind is Studio:
        return request.app.state.studio
    try:
        return kind(named[name])
    except (KeyError, ValueError):
        raise Refused(422, "this address is not complete; reload the page") from None


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


async def taken_up(
    here: Studio, project: str, file: Path, called: str, made: Iterable[str], tasks: Iterable[str]
) -> None:
    """Let a table or mesh that was brought be a project's own, and forget the one before.

    Args:
        here: The studio.
        project: The project.
        file: Where what was brought is kept.
        called: What it is called.
        made: Files that were made of the one before.
        tasks: Kinds of task that may still work on that.
    """
    await run_in_threadpool(here.queue.forget, project, *tasks)
    record, kind = here.store.project(project), file.stem
    for name in (*made, *(f"{kind}{ending}" for ending in ENDINGS[kind])):
        if (old := file.with_name(name)) != file:
            old.unlink(missing_ok=True)
    changes: dict[str, Any] = {"input": {"name": called, "type": file.suffix.lstrip(".")}}
    before = Path(record["input"]["name"]).stem if record["input"] else called
    if record["name"] in (*NAMES.values(), "My table", before):
        changes["name"] = Path(called).stem
    here.store.change(project, **changes)


def whole(file: Path, kind: str = "application/json", **headers: str) -> Response:
    """Answer with a file of a project as it is now: it may be replaced or deleted at any moment."""
    try:
        return Response(file.read_bytes(), media_type=kind, headers=headers)
    except FileNotFoundError:
        raise Refused(404, "this is no longer here; reload the page") from None


async def _body(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request brings."""
    try:
        body = json.loads(await request.body() or b"{}")
    except (ValueError, RecursionError):
        raise Refused(400, "the request is no JSON; reload the page") from None
    if not is_object(body):
        raise Refused(400, "the request is no JSON object; reload the page")
    return body


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
