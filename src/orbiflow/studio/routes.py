"""Routes: what a browser asks for by an address, answered by a function of what the address names."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, get_type_hints

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from orbiflow.studio.guard import Refused
from orbiflow.studio.requests import Studio

Answer = TypeVar("Answer", bound=Callable[..., Any])


class Routes(list[Route]):
    """Routes of one topic; `get`, `put` and so on decorate the functions that answer.

    A function is given what it names: a `Request`, the `Studio`, parts of the address in braces, and
    what comes after its question mark, as texts or whole numbers. It returns a response, or what JSON
    has.
    """

    def __init__(self, prefix: str = "") -> None:
        super().__init__()
        self.prefix = prefix

    def get(self, path: str) -> Callable[[Answer], Answer]:
        """Answer GET."""
        return self._adding(path, "GET")

    def post(self, path: str) -> Callable[[Answer], Answer]:
        """Answer POST."""
        return self._adding(path, "POST")

    def put(self, path: str) -> Callable[[Answer], Answer]:
        """Answer PUT."""
        return self._adding(path, "PUT")

    def patch(self, path: str) -> Callable[[Answer], Answer]:
        """Answer PATCH."""
        return self._adding(path, "PATCH")

    def delete(self, path: str) -> Callable[[Answer], Answer]:
        """Answer DELETE."""
        return self._adding(path, "DELETE")

    def _adding(self, path: str, method: str) -> Callable[[Answer], Answer]:
        def add(answer: Answer) -> Answer:
            self.append(Route(self.prefix + path, _endpoint(answer), methods=[method]))
            return answer

        return add


def _endpoint(answer: Callable[..., Any]) -> Callable[[Request], Any]:
    """Return a function that gives another what it names of a request."""
    kinds = get_type_hints(answer)
    kinds.pop("return", None)
    defaults = {
        name: own.default
        for name, own in inspect.signature(answer).parameters.items()
        if own.default is not own.empty
    }

    async def endpoint(request: Request) -> Response:
        named = {**defaults, **request.query_params, **request.path_params}
        given = {name: _value(kind, name, named, request) for name, kind in kinds.items()}
        if inspect.iscoroutinefunction(answer):
            found = await answer(**given)
        else:
            found = await run_in_threadpool(answer, **given)
        return found if isinstance(found, Response) else JSONResponse(found)

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
