"""What is offered of a tile is what it can do, and previews are what is made."""

import base64
import io
import json
import zipfile
from typing import Any

import numpy as np
import pytest
from PIL import Image

from bent_tiles import bent_tile
from orbiflow.errors import SettingError
from orbiflow.studio.tile_files import tile_number
from orbiflow.tiles import ArtSettings, EscherTile, why_not_in
from studio.served import Client, house_tile, new_project, put_card, worked

CLASSES = ["IH1", "IH2", "IH4", "IH6", "IH7", "IH21", "IH28"]


@pytest.fixture(scope="module", name="tiles")
def tiles_fixture(client: Client) -> dict[str, str]:
    """The addresses of tiles of a project, by class."""
    project, found = new_project(client), dict[str, str]()
    for place, name in enumerate(CLASSES):
        number = tile_number(900, place)
        put_card(client, project, number, EscherTile(bent_tile(name, 40.0)))
        found[name] = f"{project}/tiles/{number}"
    return found


@pytest.mark.parametrize(
    ("name", "world"),
    [
        *(("IH1", "sphere"), ("IH28", "sphere"), ("IH1", "disc"), ("IH4", "half-plane")),
        *(("IH6", "band"), ("IH28", "band")),
    ],
)
def test_what_is_not_offered_is_what_would_be_refused(
    client: Client, tiles: dict[str, str], name: str, world: str
) -> None:
    told = client.get(f"{tiles[name]}/cannot").json().get("art", [])
    refused = {value: own for own in told for value in own["values"]}
    number = int(tiles[name].rsplit("/", 1)[1])
    body = {"operation": "art", "settings": {"tile": number, "world": world, "area": "99x99px"}}
    answer = client.post(f"{tiles[name]}/preview", json={**body, "side": 100})
    assert (answer.status_code == 200) == (world not in refused), answer.text
    if world in refused:
        other = refused[world]["instead"]
        able = next(key for key, own in tiles.items() if own.endswith(f"/{other}"))
        assert not why_not_in(EscherTile(bent_tile(able, 40.0)), world)


def test_a_ball_is_offered_where_a_sphere_is(client: Client, tiles: dict[str, str]) -> None:
    for name in CLASSES:
        told = client.get(f"{tiles[name]}/cannot").json()
        lacks = {value for own in told.get("solid", []) for value in own["values"]}
        assert lacks == (
            set() if name in ("IH7", "IH21", "IH28") else {"ball", "ball-piece", "lamp"}
        )


GIVEN: dict[str, Any] = {
    **{"tile_size": 20, "rotate": 30, "clip": False, "area": "200x200px", "order": "3"},
    **{"arms": "3,5", "stages": 2, "stretch": 0.05},
}


@pytest.mark.parametrize("chosen", ["world", "metamorphosis", "repeat"])
def test_settings_that_would_be_refused_are_not_offered(client: Client, chosen: str) -> None:
    properties = client.get("/api/operations/art/schema").json()["properties"]
    choices = next(own["enum"] for own in properties[chosen]["anyOf"] if "enum" in own)
    for value in choices:
        for name, given in GIVEN.items():
            needed = properties[name]["x-only-with"]
            own = {chosen: value}
            offered = all(own.get(other) in allowed for other, allowed in needed.items())
            try:
                ArtSettings(**{chosen: value, name: given})
            except SettingError:
                assert not offered, (value, name)
            else:
                assert offered, (value, name)


STROKE = {"colour": "#d02030", "width": 1.5, "points": [[0.0, 0.0], [4.0, 2.0]]}


@pytest.fixture(scope="module")
def address(client: Client) -> str:
    """The address of a tile of a project that was drawn on."""
    tile = house_tile(client)
    project = tile.partition("/tiles/")[0]
    client.patch(project, json={"view": {"drawing": {"strokes": [STROKE], "eyes": []}}})
    return tile


def preview(
    client: Client, address: str, operation: str, side: float = 1000, **settings: Any
) -> Any:
    """Ask for a preview; return the server's answer."""
    number = int(address.rsplit("/", 1)[1])
    body = {"operation": operation, "side": side, "settings": {"tile": number, **settings}}
    return client.post(f"{address}/preview", json=body)


def image_of(answer: Any) -> Image.Image:
    assert answer.status_code == 200, answer.text
    return Image.open(io.BytesIO(base64.b64decode(answer.json()["image"])))


def test_it_is_what_is_made_and_nothing_is_left_of_it(client: Client, address: str) -> None:
    project, number = address.split("/tiles/")
    known = client.get(project).json()["tasks"]
    settings: dict[str, Any] = {"drawing": True, "purpose": "print", "area": "120x80mm"}
    settings |= {"format": "png", "dpi": 100}
    shown = np.asarray(image_of(preview(client, address, "export", **settings)).convert("RGB"))
    assert client.get(project).json()["tasks"] == known
    task = worked(client, project, "export", tile=int(number), **settings)
    [file] = task["result"]["files"]
    made = client.get(f"/api/takeaways/{task['id']}/files/{file['name']}").content
    wanted = np.asarray(Image.open(io.BytesIO(made)).convert("RGB"))
    assert shown.shape == wanted.shape
    assert (shown == wanted).all()
    plain = image_of(preview(client, address, "export", **{**settings, "drawing": False}))
    assert (np.asarray(plain.convert("RGB")) != wanted).any()


@pytest.mark.parametrize(
    ("operation", "settings"),
    [
        ("export", {"purpose": "laser", "format": "dxf"}),
        ("export", {"cut": "pieces", "kerf": 0.2, "bed": "100x100mm", "area": "200x200mm"}),
        ("art", {"area": "3000x2000px"}),
        ("solid", {"kind": "cutter"}),
        ("animate", {"kind": "grow"}),
        ("art", {"world": "spiral"}),
        ("art", {"world": "disc", "format": "html"}),
    ],
)
def test_all_that_can_be_made_is_shown_small(
    client: Client, address: str, operation: str, settings: dict[str, Any]
) -> None:
    image = image_of(preview(client, address, operation, side=300, **settings))
    assert 100 < max(image.size) <= 360


def test_a_world_is_made_to_be_turned(client: Client, address: str) -> None:
    project, _, number = address.rpartition("/tiles/")
    task = worked(client, project, "art", tile=int(number), world="disc", format="html")
    [file] = task["result"]["files"]
    assert file["name"].endswith(".html")
    made = client.get(f"/api/takeaways/{task['id']}/files/{file['name']}")
    assert "showWorld" in made.text
    assert made.headers["content-type"].startswith("text/html")
    assert "content-disposition" not in made.headers
    assert "sandbox allow-scripts" in made.headers["content-security-policy"]


def test_what_cannot_be_made_is_refused_beside_its_setting(client, address, monkeypatch) -> None:
    for there in ("/usr/bin/ffmpeg", None):
        monkeypatch.setattr("shutil.which", lambda _, there=there: there)
        schema = client.get("/api/operations/animate/schema").json()
        offered = json.dumps(schema["properties"]["format"])
        assert ("gif" in offered, "mp4" in offered) == (True, bool(there))
    answer = preview(client, address, "export", tile_size="99999mm")
    assert (answer.status_code, answer.json()["setting"]) == (422, "tile_size")
    assert preview(client, address, "search").status_code == 422
    missing = client.post(f"{address}7/preview", json={"operation": "export", "settings": {}})
    assert missing.status_code == 404


def test_several_sheets_are_one_archive(client: Client) -> None:
    tile = house_tile(client)
    own, _, number = tile.partition("/tiles/")
    sheets = {"purpose": "laser", "area": "300x200mm", "bed": "160x110mm"}
    task = worked(client, own, "export", tile=int(number), format="svg", **sheets)
    (file,) = task["result"]["files"]
    made = f"/api/takeaways/{task['result']['takeaway']}/files/{file['name']}"
    content = client.get(made).content
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert len(archive.namelist()) == 5
        assert all(archive.read(name).startswith(b"<?xml") for name in archive.namelist())
