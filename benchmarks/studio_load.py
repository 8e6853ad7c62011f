"""How quick the studio is: for one who waits for the first tiles, and for many who come at once.

    python benchmarks/studio_load.py [--quick] [--clients 20] [--projects 1000]

Starts a server of its own on this machine, with an empty folder. First one client searches a turtle;
then so many come at once, each with a picture, a search, and a page that asks for the project again
and again. Times of requests leave out uploads. Processes of the server are measured on Linux only.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path

import httpx
import numpy as np

STATIC = Path(__file__).parents[1] / "src" / "orbiflow" / "studio" / "static"
IDLE = """
import sys, uvicorn
async def app(scope, receive, send):
    if scope["type"] == "http":
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})
uvicorn.run(app, port=int(sys.argv[1]), log_level="error", lifespan="off")
"""
"""A server that does nothing: what it takes at the same time is the machine's."""

HEADERS = {"X-Orbiflow": "1"}
PAUSE = 0.5  # seconds between two looks of a client at its project


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--clients", type=int, default=20)
    parser.add_argument("--projects", type=int, default=1000)
    given = parser.parse_args()
    clients, projects = (4, 100) if given.quick else (given.clients, given.projects)
    page_weight()
    with tempfile.TemporaryDirectory() as folder, socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        free.close()
        begin = time.perf_counter()
        idle = subprocess.Popen([sys.executable, "-c", IDLE, str(port + 1)])
        server = subprocess.Popen(
            [
                *(sys.executable, "-m", "orbiflow", "studio", "--no-browser"),
                *("--port", str(port), "--data", folder),
            ],
            stdout=subprocess.DEVNULL,
        )
        try:
            asyncio.run(measured(f"http://127.0.0.1:{port}", server.pid, clients, projects, begin))
        finally:
            for process in (server, idle):
                process.kill()
                process.wait()


def page_weight() -> None:
    """Print what the start page loads: files that pages name, and those that they name."""
    waiting, seen = ["index.html"], set[str]()
    while waiting:
        name = waiting.pop()
        file = (STATIC / name).resolve()
        if name in seen or not file.is_file():
            continue
        seen.add(name)
        text = file.read_text("utf-8", errors="ignore") if file.suffix != ".png" else ""
        for found in re.findall(
            r'(?:from|import|href=|src=)\s*\(?["\'](?!http)([^"\'#]+)["\']', text
        ):
            place = STATIC if found.startswith("/") else file.parent
            target = (place / found.lstrip("/")).resolve()
            if target.is_relative_to(STATIC):
                waiting.append(str(target.relative_to(STATIC)))
    own = sum((STATIC / name).stat().st_size for name in seen)
    whole = sum(file.stat().st_size for file in STATIC.rglob("*") if file.is_file())
    print(f"page: {len(seen)} files, {own / 1000:.0f} kB at most; all pages {whole / 1000:.0f} kB")


async def measured(base: str, server: int, clients: int, projects: int, begin: float) -> None:
    limits = httpx.Limits(max_connections=None)
    async with httpx.AsyncClient(
        base_url=base, headers=HEADERS, timeout=300, limits=limits
    ) as client:
        while True:
            with suppress(httpx.TransportError):
                await client.get("/api/projects")
                break
            await asyncio.sleep(0.02)
        print(f"server: answers {time.perf_counter() - begin:.2f} s after its start")
        await asyncio.sleep(5)  # a worker gets ready, as while a user looks for a picture
        await alone(client)
        if clients:
            await many(client, server, clients)
        if projects:
            await crowded(client, projects)


async def alone(client: httpx.AsyncClient) -> None:
    """Print when the first tiles of a search are on the screen."""
    project = await new_project(client, "turtle")
    begin = time.perf_counter()
    await client.post(f"{project}/tasks", json={"operation": "search", "settings": {}})
    cards: dict[int, float] = {}
    async for kind, data in events(client, project):
        now = time.perf_counter() - begin
        if kind == "card":
            cards.setdefault(data["id"], now)
        if kind == "task" and data["operation"] == "search" and data["state"] == "done":
            break
    times = sorted(cards.values())
    nine = times[8] if len(times) >= 9 else float("nan")
    print(
        f"search: first certified tile after {times[0]:.2f} s, nine after {nine:.2f} s, "
        f"the end after {now:.1f} s"
    )


async def many(client: httpx.AsyncClient, server: int, count: int) -> None:
    """Print the longest request while so many work at once, and what was lost."""
    times: list[tuple[float, str]] = []
    idle: list[float] = []
    memory = [0.0, 0.0]
    watch = asyncio.create_task(watched(server, memory))
    begin = time.perf_counter()
    other = asyncio.create_task(asked_meanwhile(client.base_url.copy_with(path="/"), idle))
    ends = await asyncio.gather(*(one_of_many(client, times, k) for k in range(count)))
    watch.cancel()
    other.cancel()
    whole = time.perf_counter() - begin
    own = np.array([took for took, _ in times])
    longest, what = max(times)
    lost = [end for end in ends if end != "done"]
    print(
        f"{count} clients: {len(times)} requests in {whole:.0f} s, longest {1000 * longest:.0f} ms "
        f"({what}), 99 of 100 below {1000 * np.quantile(own, 0.99):.0f} ms; {len(lost)} searches "
        f"lost {lost or ''}"
    )
    print(
        f"a server that does nothing, at the same time: {len(idle)} requests, longest "
        f"{1000 * max(idle):.0f} ms, 99 of 100 below {1000 * np.quantile(idle, 0.99):.0f} ms"
    )
    print(f"memory: server {memory[0]:.0f} MB, with all workers {memory[1]:.0f} MB at most")


async def asked_meanwhile(base: httpx.URL, times: list[float]) -> None:
    """Ask the server that does nothing again and again."""
    async with httpx.AsyncClient(base_url=base.copy_with(port=(base.port or 0) + 1)) as client:
        while True:
            begin = time.perf_counter()
            await client.get("/", timeout=300)
            times.append(time.perf_counter() - begin)
            await asyncio.sleep(PAUSE / 10)


async def one_of_many(client: httpx.AsyncClient, times: list[tuple[float, str]], k: int) -> str:
    async def ask(method: str, path: str, **more: object) -> httpx.Response:
        begin = time.perf_counter()
        answer = await client.request(method, path, **more)  # pyright: ignore[reportArgumentType]
        times.append((time.perf_counter() - begin, f"{method} {path.split('/')[-1]}"))
        answer.raise_for_status()
        return answer

    animals = (await ask("GET", "/api/about")).json()["animals"]
    project = await new_project(client, animals[k % len(animals)]["name"])
    settings = {"effort": "fast", "classes": ["IH4", "IH6"]}
    asked = await ask(
        "POST", f"{project}/tasks", json={"operation": "search", "settings": settings}
    )
    task = asked.json()["task"]["id"]
    for turn in range(10**6):
        await asyncio.sleep(PAUSE)
        found = (await ask("GET", project)).json()
        await ask("PATCH", project, json={"view": {"turn": turn}})
        await ask("GET", "/api/projects")
        (state,) = (own["state"] for own in found["tasks"] if own["id"] == task)
        if state not in ("waiting", "running"):
            return state
    raise AssertionError


async def crowded(client: httpx.AsyncClient, count: int) -> None:
    """Print how long the list of many projects takes."""
    answers = [await client.post("/api/projects", json={}) for _ in range(count)]
    refused = sum(answer.status_code != 200 for answer in answers)
    begin = time.perf_counter()
    found = (await client.get("/api/projects")).json()
    took = time.perf_counter() - begin
    print(f"{len(found)} projects ({refused} more refused): listed in {1000 * took:.0f} ms")


async def new_project(client: httpx.AsyncClient, animal: str) -> str:
    """Return the address of a project whose silhouette is read."""
    made = (await client.post("/api/projects", json={})).json()
    project = f"/api/projects/{made['id']}"
    await client.post(f"{project}/animal", json={"name": animal})
    async for kind, data in events(client, project):
        if kind == "silhouette" and data["silhouette"] is not None:
            break
    return project


async def events(client: httpx.AsyncClient, project: str) -> AsyncIterator[tuple[str, dict]]:
    """Yield the events of a project."""
    async with client.stream("GET", f"{project}/events") as stream:
        kind = ""
        async for line in stream.aiter_lines():
            if line.startswith("event: "):
                kind = line[7:]
            elif line.startswith("data: "):
                yield kind, json.loads(line[6:])


async def watched(server: int, most: list[float]) -> None:
    """Keep the largest memory in MB of the server, and of it with all that it started."""
    while Path("/proc").exists():
        own, whole = memory_of(server)
        most[0], most[1] = max(most[0], own), max(most[1], whole)
        await asyncio.sleep(1)


def memory_of(server: int) -> tuple[float, float]:
    """Return the proportional memory in MB of a process, and of it and its descendants."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parents[int(entry.parent.name)] = int(entry.read_text().rpartition(")")[2].split()[1])
    family, fresh = {server}, {server}
    while fresh:
        fresh = {pid for pid, parent in parents.items() if parent in fresh} - family
        family |= fresh
    sizes: dict[int, float] = {}
    for pid in family:
        with suppress(OSError):
            text = Path(f"/proc/{pid}/smaps_rollup").read_text()
            sizes[pid] = int(re.findall(r"^Pss:\s+(\d+)", text, re.MULTILINE)[0]) / 1024
    return sizes.get(server, 0.0), sum(sizes.values())


if __name__ == "__main__":
    main()
