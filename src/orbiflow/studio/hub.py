"""Streams of events: whoever watches a project hears of every change, and can come back later."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator
from typing import Any

from orbiflow.studio.store import Missing, Store
from orbiflow.studio.words import shown_project, shown_task

KEEPALIVE_COMMENT = b": still here\n\n"

KEEPALIVE_SECONDS = 15.0  # seconds after which a stream without news says that it is still there
COLLECT_SECONDS = 0.02  # seconds in which changes are collected


class Hub:
    """Who watches which project."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self.count = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._watching: dict[str, set[asyncio.Event]] = {}
        self._closed = False

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin to listen to the store."""
        self._loop = loop
        self.store.listeners.add(self._changed)

    def close(self) -> None:
        """End all streams."""
        self._closed = True
        self.store.listeners.discard(self._changed)
        for project in self._watching:
            self._wake(project)

    def _changed(self, project: str) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake, project)

    def _wake(self, project: str) -> None:
        for event in self._watching.get(project, ()):
            event.set()

    async def changes(self, project: str) -> AsyncGenerator[bool]:
        """Yield at once and after each change of a project; False if nothing changed for a while."""
        wake = asyncio.Event()
        self._watching.setdefault(project, set()).add(wake)
        self.count += 1
        try:
            yield True
            while not self._closed:
                try:
                    async with asyncio.timeout(KEEPALIVE_SECONDS):
                        await wake.wait()
                except TimeoutError:
                    yield False
                    continue
                await asyncio.sleep(COLLECT_SECONDS)
                wake.clear()
                yield True
        finally:
            self.count -= 1
            self._watching[project].discard(wake)
            if not self._watching[project]:
                del self._watching[project]

    async def stream(self, project: str, after: int) -> AsyncGenerator[bytes]:
        """Yield the events of a project after one, as a browser takes them."""
        yield KEEPALIVE_COMMENT
        changes = self.changes(project)
        try:
            async for changed in changes:
                if not changed:
                    yield KEEPALIVE_COMMENT
                    continue
                try:
                    fresh = self._fresh(project, after)
                except Missing:
                    yield _event(after, "gone", {"project": project})
                    return
                for number, kind, data in fresh:
                    yield _event(number, kind, data)
                    after = number
        finally:
            await changes.aclose()

    def _fresh(self, project: str, after: int) -> list[tuple[int, str, Any]]:
        with self.store.still():
            whole = self.store.project(project)
            fresh: list[tuple[int, str, Any]] = []
            for event in self.store.events(project, after):
                kind, subject, data = event["kind"], event["subject"], event["data"]
                if kind == "task":
                    data = shown_task(self.store, self.store.task(int(subject)))
                elif kind == "card":
                    data = self.store.card(project, int(subject))
                elif kind in ("silhouette", "project"):
                    data = shown_project(self.store, whole, kind)
                fresh.append((event["id"], kind, data))
        return fresh


def _event(number: int, kind: str, data: Any) -> bytes:
    return f"event: {kind}\ndata: {json.dumps(data)}\nid: {number}\n\n".encode()
