"""A studio for tests: the real application, with tasks that run in this very process."""

import asyncio
import json
import queue
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import httpx

from bent_tiles import bent_tile
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Call, CallProcess, Cancel, Event, Failed, Finished, ItemDone
from orbiflow.studio import Limits, Store, WorkQueue, create_app
from orbiflow.studio.tile_files import put_tile, tile_number
from orbiflow.tiles import EscherTile

SQUARE = b"[[0, 0], [80, 0], [80, 60], [40, 90], [0, 60]]"


class InThread:
    """A process that is none: it does its call when its events are read."""

    pid, alive = 0, True

    def __init__(self) -> None:
        self.cancel = Cancel()
        self.done: Call | None = None

    def begin(self, call: Call) -> None:
        self.done = call

    def events(self) -> Iterator[Event]:
        assert self.done is not None
        told: list[Event] = []
        try:
            self.done.run(told.append, self.cancel)
        except OrbiflowError:
            pass
        except Exception as error:
            told.append(Failed(str(error), "error"))
        yield from told

    def wait(self) -> int:
        return 0

    def kill(self) -> None:
        self.cancel.cancel()


class ByHand:
    """A process that does what a test says."""

    alive = True

    def __init__(self, number: int) -> None:
        self.pid, self.call, self.log = 0, None, list[str]()
        self.number, self._begun = number, threading.Event()
        self._said: queue.Queue[Event | None] = queue.Queue()

    def begin(self, call: Call) -> None:
        self.call = call
        self.log.append("begin")
        self._begun.set()

    def say(self, event: Event | None) -> None:
        self._said.put(event)

    def finish(self) -> None:
        self.say(Finished("done", {}))
        self.say(None)
        join_tasks(f"task {self.task}")

    @property
    def task(self) -> int:
        self._begun.wait()
        return cast(Call, self.call).flat["task"]

    def events(self) -> Iterator[Event]:
        while (event := self._said.get()) is not None:
            yield event

    def wait(self) -> int:
        return 0

    def pause(self) -> bool:
        self._begun.wait()
        self.log.append("pause")
        return True

    def resume(self) -> bool:
        self.log.append("resume")
        return True

    def kill(self) -> None:
        self._begun.wait()
        self.log.append("kill")
        self.say(None)


class Bench:
    """A queue whose processes are a test's own, in the order in which they began."""

    def __init__(self, folder: Path, **slots: int) -> None:
        self.store = Store(folder)
        self.made: list[ByHand] = []
        self.queue = WorkQueue(
            self.store,
            slots={"long": 1, "quick": 1, **slots},
            spares=0,
            spawn=lambda: cast(CallProcess, self._make()),
        )

    def _make(self) -> ByHand:
        self.made.append(ByHand(len(self.made)))
        return self.made[-1]

    def project(self) -> str:
        return self.store.create("tile", "a project", 100)

    def search(self, project: str) -> int:
        return self.queue.submit(project, "search", {})

    def states(self, *tasks: int) -> list[str]:
        return [self.store.task(task)["state"] for task in tasks]

    @property
    def begun(self) -> list[int]:
        return [process.task for process in self.made]


def join_tasks(name: str = "task ") -> None:
    """Wait for the threads that follow tasks."""
    for thread in threading.enumerate():
        if thread.name == name or (name == "task " and thread.name.startswith(name)):
            thread.join()


class Client:
    """A browser's part: requests to an application, one after another."""

    def __init__(self, app: Any, runner: asyncio.Runner, headers: dict[str, str]) -> None:
        self.studio = app.app.state.studio
        """The application's `store`, `queue`, `hub` and `limits`."""
        self.app, self.headers, self.runner = app, headers, runner
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        self._client = httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8437")

    def request(
        self, method: str, path: str, headers: dict[str, str] | None = None, **more: Any
    ) -> httpx.Response:
        if isinstance(content := more.get("content"), Iterator):
            more["content"] = _later(content)
        asked = self._client.request(
            method, path, headers={**self.headers, **(headers or {})}, **more
        )
        return self.runner.run(asked)

    def __getattr__(self, method: str) -> Any:
        return lambda path, **more: self.request(method.upper(), path, **more)


async def _later(parts: Iterator[bytes]) -> AsyncIterator[bytes]:
    for part in parts:
        yield part


@contextmanager
def studio(folder: Path, *, token: str = "", **limits: Any) -> Iterator[Client]:
    """Serve a studio; the client sends what the studio's own page sends."""
    store = Store(folder)
    work = WorkQueue(store, spares=0, spawn=lambda: cast(CallProcess, InThread()))
    app = cast(Any, create_app(store, work, Limits(**limits), token=token))
    life = app.app.router.lifespan_context(app.app)
    with asyncio.Runner() as runner:
        runner.run(life.__aenter__())
        yield Client(app, runner, {"X-Orbiflow": "1"})
        runner.run(life.__aexit__(None, None, None))


def done(client: Client, answer: Any) -> dict[str, Any]:
    """Return a task once it has ended."""
    join_tasks()
    number, path = answer.json()["task"]["id"], answer.request.url.path
    project = client.get("/".join(path.split("/")[:4])).json()
    return next(task for task in project["tasks"] if task["id"] == number)


def worked(client: Client, own: str, operation: str, **settings: Any) -> dict[str, Any]:
    """A task that has ended."""
    body = {"operation": operation, "settings": settings}
    answer = client.post(f"{own}/tasks", json=body)
    assert answer.status_code == 200, answer.text
    return done(client, answer)


def new_project(client: Client) -> str:
    """Return the address of a new project."""
    return f"/api/projects/{client.post('/api/projects', json={}).json()['id']}"


def house_project(client: Client) -> str:
    """The address of a new project with a silhouette."""
    project = new_project(client)
    done(client, client.put(f"{project}/input?name=house.json", content=SQUARE))
    return project


def put_card(
    client: Client, project: str, number: int, tile: EscherTile | None = None, **more: Any
) -> dict[str, Any]:
    """Put a tile, which no search has found, into a project as a worker does; return its card."""
    store, name, told = client.studio.store, project.split("/")[-1], list[Any]()
    tile = tile or EscherTile(bent_tile("IH4", 40.0), name="house-IH4")
    put_tile(store.home(name), number, "final", tile, told.append, more)
    assert told == [ItemDone(f"{number}/final", "done", "tile")]
    card = json.loads((store.home(name) / f"tiles/{number}/final/card.json").read_text())
    store.put_card(name, number, card)
    return card


def house_tile(client: Client) -> str:
    """The address of a tile of a new project."""
    project, number = house_project(client), tile_number(900, 0)
    put_card(client, project, number)
    return f"{project}/tiles/{number}"
