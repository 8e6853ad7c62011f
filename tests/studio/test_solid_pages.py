"""Solids in the studio: meshes that are uploaded, searches, what pages are shown of them, and files."""

import io
import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import orbiflow.solids
from orbiflow.solids import EscherSolid, FillSettings, Mesh, SolidLikeness, read_solid
from orbiflow.solids.reading import READERS
from orbiflow.studio.brought_files import ENDINGS
from orbiflow.studio.settings import Job
from orbiflow.studio.solid_routes import FILES
from orbiflow.studio.solid_tasks import put_solid
from solids.mesh_files import ball, bare_reads, box, bumpy_cell, cubic_group, inside_out, obj, stl
from solids.mesh_files import three_mf as packed
from studio.served import Client, done, new_project, studio, worked

BUMPY = bumpy_cell(steps=4)
UPLOAD = 60_000


@pytest.fixture(scope="module", name="client")
def client_fixture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    small = partial(orbiflow.solids.solid_sheet, width=160)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(orbiflow.solids, "solid_sheet", small)
        with studio(tmp_path_factory.mktemp("solids"), upload=UPLOAD) as served:
            yield served


def solid_of(score: float, mesh: Mesh = BUMPY) -> EscherSolid:
    """A solid whose copies fill space, that looks so much like its figure."""
    values = dict.fromkeys(SolidLikeness.__annotations__, score)
    likeness = SolidLikeness(**values)
    return EscherSolid("bumpy", cubic_group(), mesh, mesh, mesh, 30.0, likeness, np.eye(3))


def solid_project(client: Client) -> str:
    """The address of a new project for a mesh."""
    made = client.post("/api/projects", json={"kind": "solid"}).json()
    return f"/api/projects/{made['id']}"


def uploaded(client: Client, data: bytes, name: str) -> tuple[str, dict[str, Any]]:
    """The address of a project with a mesh, and the task that read it."""
    own = solid_project(client)
    answer = client.put(f"{own}/mesh", params={"name": name}, content=data)
    assert answer.status_code == 200, answer.text
    return own, done(client, answer)


def home(client: Client, own: str) -> Path:
    return client.studio.store.home(own.rsplit("/", 1)[1])


class Search:
    """A search that finds what a test says, and what it was asked for."""

    def __init__(self, client: Client, patch: pytest.MonkeyPatch) -> None:
        self.client, self.patch = client, patch
        self.asked, self.name = FillSettings(), ""

    def __call__(self, own: str, found: list[EscherSolid], **settings: Any) -> dict[str, Any]:
        """Return the task once it has ended."""

        def fill(mesh: Mesh, asked: FillSettings, **more: Any) -> list[EscherSolid]:
            assert mesh.is_closed
            self.asked, self.name = asked, more["name"]
            for solid in found:
                more["on_solid"](solid)
            return sorted(found, key=lambda one: -one.likeness.score)[: asked.tiles]

        self.patch.setattr(orbiflow.solids, "fill", fill, raising=False)
        return worked(self.client, own, "fill", **settings)


@pytest.fixture(name="search")
def search_fixture(client: Client, monkeypatch: pytest.MonkeyPatch) -> Search:
    return Search(client, monkeypatch)


@pytest.fixture(scope="module", name="filled")
def filled_fixture(client: Client) -> str:
    """The address of a mesh with one solid: one for all tests."""
    own, _ = uploaded(client, obj(BUMPY), "bumpy thing.obj")
    with pytest.MonkeyPatch.context() as patch:
        task = Search(client, patch)(own, [solid_of(0.9)])
    assert task["state"] == "done", task["error"]
    return own


@pytest.mark.parametrize(
    ("name", "data", "up"),
    [("a.stl", stl(ball()), "z"), ("a.OBJ", obj(ball()), "y"), ("a.3mf", packed(ball()), "z")],
)
def test_a_mesh_is_read_and_drawn(client: Client, name: str, data: bytes, up: str) -> None:
    own, task = uploaded(client, data, name)
    assert task["state"] == "done", task["error"]
    mesh = client.get(f"{own}/mesh").json()["mesh"]
    assert (mesh["called"], mesh["triangles"], mesh["up"]) == (name, len(ball().faces), up)
    np.testing.assert_allclose([mesh["low"], mesh["high"]], [[-1] * 3, [1] * 3], atol=1e-5)
    assert mesh["usual_size"] == 60
    figure = client.get(f"{own}/mesh/figure").json()
    assert set(figure["meshes"]) == {"target"}
    assert figure["copies"] == []
    assert client.get(own).json()["name"] == "a"
    (summary,) = [one for one in client.get("/api/projects").json() if one["id"] in own]
    picture = Image.open(io.BytesIO(client.get(summary["thumb"]).content))
    assert np.ptp(np.asarray(picture.convert("L"))) > 100


def test_what_was_mended_is_said(client: Client) -> None:
    turned, _ = uploaded(client, stl(inside_out(ball())), "turned.stl")
    assert client.get(f"{turned}/mesh").json()["mesh"]["notes"]
    large, _ = uploaded(client, stl(box(30, 20, 50)), "box.stl")
    mesh = client.get(f"{large}/mesh").json()["mesh"]
    assert (mesh["usual_size"], mesh["notes"]) == (None, [])
    assert tuple(READERS) == ENDINGS["mesh"]  # what is uploaded is what is read


GLTF = b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "%s", "byteLength": 9}]}'
SHEET = Mesh(np.eye(3), np.array([[0, 1, 2]]))
HOSTILE = {
    "sheet.stl": stl(SHEET),
    "short.stl": stl(ball())[:-40],
    "words.obj": b"v a b c\nf 1 2 3\n",
    "picture.glb": b"\x89PNG\r\n",
    "elsewhere.gltf": GLTF % b"../../etc/passwd",
    "parts.gltf": GLTF % b"parts.bin",
    "archive.3mf": b"PK\3\4nothing",
    "header.ply": b"ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_meshes_are_refused_in_words(client: Client, name: str, monkeypatch) -> None:
    if name != "parts.gltf":
        bare_reads(monkeypatch)
    own, task = uploaded(client, HOSTILE[name], name)
    assert task["state"] == "failed"
    assert not re.search("inside orbiflow|codec|File|No such", task["error"])
    assert task["error"].startswith(name)
    assert str(home(client, own)) not in task["error"]
    assert client.get(f"{own}/mesh").json()["mesh"] is None
    assert client.get(f"{own}/mesh/figure").status_code == 404
    assert "not read" in worked(client, own, "fill")["error"]


def test_other_kinds_of_file_are_not_taken_and_a_tile_has_no_mesh(client: Client) -> None:
    own = solid_project(client)
    for name in ("mesh.blend", "mesh", "mesh.stl.exe", "../../etc/passwd"):
        answer = client.put(f"{own}/mesh", params={"name": name}, content=b"1")
        assert answer.status_code == 422
        assert ".3mf" in answer.json()["error"]
    own = new_project(client)
    for answer in (
        client.get(f"{own}/mesh"),
        client.get(f"{own}/mesh/figure"),
        client.put(f"{own}/mesh", params={"name": "a.stl"}, content=b"1"),
        client.get(f"{own}/tiles/1/files/sheet.png"),
    ):
        assert answer.status_code == 404


@pytest.mark.parametrize("package", ["skimage", "trimesh", "gemmi"])
def test_what_to_install_is_said(client: Client, monkeypatch, package: str) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    answer = client.post("/api/projects", json={"kind": "solid"})
    assert answer.status_code == 422
    extra = "crystals" if package == "gemmi" else "solids"
    assert f"a solid needs {package}" in answer.json()["error"]
    assert f"pip install 'orbiflow[{extra}]'" in answer.json()["error"]


def test_a_search_takes_the_settings_of_the_command(client: Client, search: Search) -> None:
    own, _ = uploaded(client, obj(BUMPY), "thing.obj")
    search(
        own, [solid_of(0.5)], effort="fast", groups="P 1, P -1", size="40mm", emphasis=["0 0 0 1"]
    )
    asked, name = search.asked, search.name
    assert (asked.effort, asked.groups, asked.size, asked.up) == ("fast", ("P 1", "P -1"), 40, "y")
    assert (asked.emphasis, name) == (("0 0 0 1",), "thing")
    for wrong in ({"effort": "endless"}, {"out": "/tmp/x"}, {"emphasis": ["here"]}, {"size": -1}):
        body = {"operation": "fill", "settings": wrong}
        assert client.post(f"{own}/tasks", json=body).status_code == 422


def test_solids_come_best_first_and_those_that_are_too_many_go(client, search: Search) -> None:
    own, _ = uploaded(client, obj(BUMPY), "thing.obj")
    before = client.get(f"{own}/backdrop.png").content
    task = search(own, [solid_of(0.5), solid_of(0.7), solid_of(0.6)], tiles=2)
    assert (task["state"], task["result"]["solids"]) == ("done", 2)
    cards = client.get(own).json()["tiles"]
    assert [card["shadows"] for card in cards] == [0.7, 0.6]
    assert all(card["certified"] for card in cards)
    assert len(list((home(client, own) / "tiles").iterdir())) == 2
    assert client.get(f"{own}/backdrop.png").content != before
    again = search(own, [], tiles=2)
    assert again["state"] == "done"
    assert "no solid was found" in again["result"]["notes"][0]
    assert len(client.get(own).json()["tiles"]) == 2


def test_a_search_that_begins_anew_keeps_what_it_had(tmp_path: Path) -> None:
    job, events, one, two = Job(project=tmp_path, task=7), [], solid_of(0.5), solid_of(0.6)
    first = put_solid(job, one, events.append)
    (card,) = tmp_path.glob("tiles/*/final/card.json")
    before = card.stat().st_mtime_ns
    again = [put_solid(job, solid, events.append) for solid in (two, one)]
    assert again == [first + 1, first]
    assert card.stat().st_mtime_ns == before
    assert [event.name for event in events] == [f"{first}/final", f"{first + 1}/final"]


def test_a_solid_is_shown_by_the_shared_script(client: Client, filled: str) -> None:
    (card,) = client.get(filled).json()["tiles"]
    view = client.get(f"{filled}/tiles/{card['id']}").json()
    assert set(view["meshes"]) == {"target", "bent", "tile"}
    assert len(view["copies"]) == 24
    (folder,) = home(client, filled).glob("tiles/*/final/tile")
    solid = read_solid(folder)  # as the command reads it
    assert solid.certificate.valid
    assert solid.millimetres == 30
    script = client.get("/api/scripts/stack.js")
    assert "javascript" in script.headers["content-type"]
    assert "export function showStack" in script.text


def test_sheet_and_page_are_kept(client: Client, filled: str) -> None:
    (card,) = client.get(filled).json()["tiles"]
    for name in FILES:
        answer = client.get(f"{filled}/tiles/{card['id']}/files/{name}")
        assert answer.content.startswith((b"\x89PNG", b"<!DOCTYPE html>"))
        assert f'filename="bumpy-thing-{name}"' in answer.headers["content-disposition"]
        assert "sandbox" in answer.headers["content-security-policy"]
    for name in ("solid.safetensors", "view.json", "..%2Fcard.json"):
        assert client.get(f"{filled}/tiles/{card['id']}/files/{name}").status_code == 404
    assert client.get(f"{filled}/tiles/{card['id'] + 1}/files/sheet.png").status_code == 404


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"format": "stl"}, "bumpy-thing-tile.stl"),
        ({"kind": "stack", "copies": 3, "size": 50}, "bumpy-thing-stack.3mf"),
        ({"kind": "block"}, "bumpy-thing-block.3mf"),
    ],
)
def test_things_to_print_are_taken_away(
    client: Client, filled: str, settings: dict[str, Any], name: str
) -> None:
    (card,) = client.get(filled).json()["tiles"]
    task = worked(client, filled, "build", tile=card["id"], **settings)
    assert task["state"] == "done", task["error"]
    assert [file["name"] for file in task["result"]["files"]] == [name]
    assert task["result"]["notes"]
    assert task["result"]["preview"]
    file = client.get(f"/api/takeaways/{task['id']}/files/{name}")
    assert "attachment" in file.headers["content-disposition"]
    assert len(file.content) > 1000


WRONG = [{"kind": "cathedral"}, {"result": "/etc"}, {"copies": 5}, {"clearance": -1}, {"out": "x"}]


def test_nothing_else_is_taken_away(client: Client, filled: str) -> None:
    (card,) = client.get(filled).json()["tiles"]
    for settings in WRONG:
        body = {"operation": "build", "settings": {"tile": card["id"], **settings}}
        assert client.post(f"{filled}/tasks", json=body).status_code == 422


def test_a_film_is_taken_away(client: Client, filled: str, monkeypatch: pytest.MonkeyPatch) -> None:
    full = orbiflow.solids.solid_gif
    monkeypatch.setattr(orbiflow.solids, "solid_gif", partial(full, size=60, frames=3))
    (card,) = client.get(filled).json()["tiles"]
    task = worked(client, filled, "film", tile=card["id"])
    assert task["state"] == "done", task["error"]
    (made,) = task["result"]["files"]
    assert made["name"] == "bumpy-thing-stack.gif"
    film = client.get(f"/api/takeaways/{task['id']}/files/{made['name']}")
    assert film.content.startswith(b"GIF8")


def test_another_mesh_begins_anew(client: Client) -> None:
    own, _ = uploaded(client, stl(ball()), "one.stl")
    done(client, client.put(f"{own}/mesh", params={"name": "two.obj"}, content=obj(box())))
    kept = {path.name for path in home(client, own).iterdir()}
    assert kept == {"mesh.obj", "mesh.json", "figure.json", "backdrop.png"}
    assert client.get(f"{own}/mesh").json()["mesh"]["triangles"] == 12
