"""Attacks on the studio: each is refused, in words, and leaves nothing behind."""

import asyncio
import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from orbiflow.studio import Limits, guard
from orbiflow.studio.guard import Guard
from png_files import promise
from studio.served import SQUARE, Client, done, new_project, studio


@pytest.fixture(scope="module", name="shared")
def shared_fixture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A studio for attacks that leave nothing behind."""
    with studio(tmp_path_factory.mktemp("shared")) as served:
        yield served
        assert served.get("/api/projects").json() == []


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Client]:
    with studio(tmp_path, upload=100_000, message=5_000, projects=20) as served:
        yield served


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in (folder / "projects").rglob("*") if p.is_file()}


OTHERS = ["http://evil.example", "http://127.0.0.1:9000", "http://127.0.0.1:84370", "null", ""]


def test_other_hosts_and_origins_are_refused(shared: Client) -> None:
    for host in ("evil.example", "evil.example:8437", "127.0.0.1", "127.0.0.1:80"):
        answer = shared.get("/api/projects", headers={"Host": host})
        assert answer.status_code == 421, host
        assert "address" in answer.json()["error"]
    for host in ("127.0.0.1:8437", "localhost:8437", "[::1]:8437"):
        assert shared.get("/api/projects", headers={"Host": host}).status_code == 200, host
    for origin, method in itertools.product(OTHERS, ("GET", "POST")):
        answer = shared.request(method, "/api/projects", headers={"Origin": origin})
        assert answer.status_code == 403, (origin, method)
    assert shared.get("/api/projects").json() == []


def test_the_own_page_is_answered_and_a_form_of_another_is_refused(client: Client) -> None:
    own = {"Origin": "http://127.0.0.1:8437"}
    assert client.post("/api/projects", json={}, headers=own).status_code == 200
    # what a form can send has no such header, and browsers say where it is from
    del client.headers["X-Orbiflow"]
    assert client.post("/api/projects", json={}).status_code == 403
    client.headers["X-Orbiflow"] = "1"
    crossed = client.get("/api/projects", headers={"Sec-Fetch-Site": "cross-site"})
    assert crossed.status_code == 403
    link = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
    assert client.get("/", headers=link).status_code == 200


def test_every_answer_forbids_inline_script(shared: Client) -> None:
    for path in ("/", "/api/about", "/no/such/page", "/api/projects/none"):
        headers = shared.get(path).headers
        policy = headers["content-security-policy"]
        assert "default-src 'none'; script-src 'self'" in policy
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"


def test_a_token_is_asked_for_where_others_may_come(tmp_path: Path) -> None:
    with studio(tmp_path, token="secret") as client:
        assert client.get("/api/projects").status_code == 401
        assert client.get("/api/projects?token=wrong").status_code == 401
        assert client.get("/api/projects", headers={"Cookie": "orbiflow=wrong"}).status_code == 401
        bearer = {"Authorization": "Bearer secret", "Host": "a.name:8437"}
        assert client.get("/api/projects", headers=bearer).status_code == 200
        welcome = client.get("/?token=secret", follow_redirects=False)
        assert (welcome.status_code, welcome.headers["location"]) == (303, "/")
        assert "HttpOnly; Path=/; SameSite=strict" in welcome.headers["set-cookie"]
        assert client.get("/api/projects").status_code == 200  # by the cookie


NAMES = ["../../../etc/passwd", "..\\..\\evil.png", "/etc/shadow", "a\0b.png"]
NAMES += ["..", "x.p/ng", "a.%2e"]


def test_names_of_uploads_lead_nowhere(client: Client, tmp_path: Path) -> None:
    address = new_project(client)
    for name in NAMES:
        done(client, client.put(f"{address}/input", params={"name": name}, content=SQUARE))
        assert not set("/\\\0") & set(client.get(address).json()["input"]["name"])
        written = {Path(file).parts for file in files(tmp_path)}
        assert {parts[:2] for parts in written} == {("projects", address.split("/")[-1])}
        assert any(parts[2].startswith("input.") for parts in written)


PATHS = [
    *("/..%2fapp.py", "/%2e%2e/app.py", "/static/..%2f..%2fstore.py"),
    *("/api/projects/..%2f..%2fstudio.sqlite3", "/api/projects/%2e%2e/backdrop.png"),
    "/api/projects/x/..%2f..%2fstudio.png",
    "/api/takeaways/1/files/..%2f..%2f..%2fstudio.sqlite3",
    *("/api/animals/..%2f..%2fstatic%2findex.png", "/api/projects/x/tiles/..%2f1"),
    "/api/projects/x/tiles/99999999999999999999999999",
]


def test_paths_lead_nowhere(shared: Client) -> None:
    for path in PATHS:
        answer = shared.get(path)
        assert answer.status_code in (404, 422), path
        assert set(answer.json()) == {"error"}


def test_what_is_too_large_is_refused_before_it_is_read(client: Client, tmp_path: Path) -> None:
    address = new_project(client)

    def endless() -> Iterator[bytes]:
        yield from itertools.repeat(b"x" * 10_000, 100)

    told = client.put(f"{address}/input?name=a.png", content=b"x" * 100_001)
    untold = client.put(f"{address}/input?name=a.png", content=endless())
    wrong = client.put(f"{address}/input", content=b"x", headers={"Content-Length": "-1"})
    message = client.patch(address, json={"view": {"a": "x" * 6_000}})
    assert [a.status_code for a in (told, untold, wrong, message)] == [413] * 4
    assert files(tmp_path) == set()


@pytest.mark.parametrize("mask", ["input?name=bomb.png", "mend"])
def test_a_bomb_is_refused_before_it_is_decoded(client: Client, tmp_path: Path, mask: str) -> None:
    address = new_project(client)
    done(client, client.put(f"{address}/input?name=a.json", content=SQUARE))
    task = done(client, client.put(f"{address}/{mask}", content=promise(50_000, 50_000)))
    assert task["state"] == "failed"
    assert "megapixels" in task["error"]
    assert str(tmp_path) not in task["error"]


NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
SVG = f"<svg {NAMESPACES} {{more}}>{{body}}</svg>"
SHAPE = '<path d="M0 0H80V60L40 90L0 60Z"/>'
LAUGHS = '<!DOCTYPE svg [<!ENTITY a "haha"><!ENTITY b "{b}">]>'.format(b="&a;" * 50)
DRAWINGS = {
    "script": SVG.format(more='onload="alert(1)"', body=f"<script>alert(1)</script>{SHAPE}"),
    "entities": LAUGHS + SVG.format(more="", body=f"<text>&b;</text>{SHAPE}"),
    "file": '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    + SVG.format(more="", body=f"<title>&x;</title>{SHAPE}"),
    "reference": SVG.format(
        more="", body=f'{SHAPE}<image xlink:href="http://evil.example/x.png" width="9" height="9"/>'
    ),
    "use": SVG.format(more="", body=f'{SHAPE}<use xlink:href="file:///etc/passwd#a"/>'),
}


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_drawings_of_others_are_never_served(client: Client, monkeypatch, drawing: str) -> None:
    def refused(*_args: Any) -> None:
        raise AssertionError("a drawing reached for the network")

    monkeypatch.setattr("socket.create_connection", refused)
    monkeypatch.setattr("urllib.request.urlopen", refused)
    address = new_project(client)
    content = DRAWINGS[drawing].encode()
    task = done(client, client.put(f"{address}/input?name=a.svg", content=content))
    text = client.get(address).text
    assert "root:" not in text
    if task["state"] == "done":
        backdrop = client.get(client.get(address).json()["silhouette"]["backdrop"])
        assert Image.open(io.BytesIO(backdrop.content)).format == "PNG"
    else:
        assert task["error"]
    for name in ("input.svg", "input", "input.png"):
        assert client.get(f"{address}/{name}").status_code in (404, 405)


def test_no_more_projects_than_allowed(client: Client, tmp_path: Path) -> None:
    answers = [client.post("/api/projects", json={}).status_code for _ in range(25)]
    assert answers == [200] * 20 + [422] * 5
    assert len(client.get("/api/projects").json()) == 20
    assert len(list((tmp_path / "projects").iterdir())) == 20


def test_no_more_tasks_of_a_project_than_allowed(tmp_path: Path) -> None:
    with studio(tmp_path, waiting=1) as client:
        address = new_project(client)
        client.studio.queue.slots["long"] = 0
        ask = {"operation": "search", "settings": {}}
        answers = [client.post(f"{address}/tasks", json=ask) for _ in range(2)]
        assert [answer.status_code for answer in answers] == [200, 422]
        assert "cancel some" in answers[1].json()["error"]


BODIES = [b"", b"[]", b"{", b"\xff", b'{"view": 3}', b"[" * 4_000, b'{"kind": {}}']


def test_bodies_that_are_no_requests(client: Client) -> None:
    address, json = new_project(client), {"Content-Type": "application/json"}
    ways = (("PATCH", address), ("POST", f"{address}/tasks"))
    for body, (method, path) in itertools.product(BODIES, ways):
        answer = client.request(method, path, content=body, headers=json)
        assert answer.status_code in (200, 400, 422), body
        assert client.get(address).json()["view"] == {}


def test_paths_cannot_be_set(client: Client) -> None:
    address = new_project(client)
    for name in ("out", "result", "picture", "force", "no such"):
        for operation in ("export", "art", "solid", "animate"):
            ask = {"operation": operation, "settings": {"tile": 1, name: "/etc/passwd"}}
            assert client.post(f"{address}/tasks", json=ask).status_code == 422


HEADERS = [(b"host", b"localhost:8437"), (b"x-orbiflow", b"1")]
SCOPE: dict[str, Any] = {"type": "http", "method": "PUT", "path": "/", "scheme": "http"}
SCOPE |= {"headers": HEADERS, "query_string": b""}


def begun(limits: Limits, parts: Iterator[bytes]) -> tuple[int, bytes]:
    """Return the status and body of a request whose body comes in these parts, and then nothing."""
    sent: list[dict[str, Any]] = []

    async def app(_scope: Any, receive: Any, _send: Any) -> None:
        while (await receive()).get("more_body"):
            pass
        raise AssertionError("the body ended")

    async def receive() -> dict[str, Any]:
        part = next(parts, None)
        if part is None:
            await asyncio.Event().wait()
        return {"type": "http.request", "body": part, "more_body": True}

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(Guard(app, limits, port=8437)(SCOPE, receive, send))
    return sent[0]["status"], sent[1]["body"]


def test_a_body_that_does_not_come_is_not_waited_for() -> None:
    status, body = begun(Limits(seconds=0.01), iter([b"a"]))
    assert status == 408
    assert b"in time" in body


def test_a_body_that_drips_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = itertools.count()
    monkeypatch.setattr(guard, "monotonic", lambda: float(next(seconds)))
    taken = itertools.count()
    status, body = begun(Limits(seconds=5), (b"a" for _ in taken))
    assert status == 408
    assert b"slowly" in body
    assert next(taken) < 10


def test_no_more_bodies_at_once_than_allowed() -> None:
    limits = Limits(uploads=1)

    async def both() -> list[Any]:
        inside, statuses = asyncio.Event(), list[Any]()

        async def app(_scope: Any, _receive: Any, _send: Any) -> None:
            inside.set()
            await asyncio.Event().wait()

        async def send(message: Any) -> None:
            statuses.append(message.get("status"))

        own = Guard(app, limits, port=8437)
        first = asyncio.create_task(own(SCOPE, None, send))  # pyright: ignore[reportArgumentType]
        await inside.wait()
        await own(SCOPE, None, send)  # pyright: ignore[reportArgumentType]
        first.cancel()
        return statuses

    assert asyncio.run(both())[0] == 503
