"""What the server does for the page of one tile: how it can be pulled, the pulled tile, the drawing."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from bent_tiles import bent_tile
from orbiflow.studio.taking import with_drawing
from orbiflow.studio.tile_files import tile_folder
from orbiflow.tiles import EscherTile, certify, read_result, save_tiles
from studio.served import Client, house_tile


@pytest.fixture(scope="module")
def address(client: Client) -> str:
    """The address of a tile of a project."""
    return house_tile(client)


def pulled_by(client: Client, address: str, size: float) -> Any:
    """Pull one point of a tile's outline; return the server's answer."""
    space = client.get(f"{address}/space").json()
    parameters = list(space["start"])
    parameters[0] += size
    return client.post(f"{address}/by-hand/pull", json={"parameters": parameters})


def test_a_pulled_tile_is_certified_and_can_be_pulled_again(client: Client, address: str) -> None:
    card = pulled_by(client, address, 0.4).json()
    project, number = address.split("/tiles/")
    assert (card["parent"], card["certified"]) == (int(number), True)
    own = tile_folder(client.studio.store.home(project.split("/")[-1]), card["id"])
    assert certify(read_result(own).tile).valid
    view = client.get(f"{project}/tiles/{card['id']}").json()
    assert {"elements", "map", "silhouette_track", "tile_track", "polygon"} <= set(view)
    again = pulled_by(client, f"{project}/tiles/{card['id']}", -0.4)
    assert again.json()["parent"] == card["id"]


@pytest.mark.parametrize(
    ("parameters", "what"),
    [(None, "crosses itself"), ([1.0], "parameters"), (["x"], "number"), ("far", "parameters")],
)
def test_what_cannot_be_is_refused_in_plain_words(
    client: Client, address: str, parameters: Any, what: str
) -> None:
    if parameters is None:
        answer = pulled_by(client, address, 500.0)
    else:
        answer = client.post(f"{address}/by-hand/pull", json={"parameters": parameters})
    assert answer.status_code in (400, 422)
    assert what in answer.json()["error"]


@pytest.mark.parametrize(("name", "near"), [("IH4", 0.97), ("IH5", 0.8), ("IH6", 0.8)])
def test_a_tile_is_laid_in_another_class(client, address, name: str, near: float) -> None:
    card = client.post(f"{address}/by-hand/class", json={"name": name}).json()
    project, number = address.split("/tiles/")
    assert (card["class_name"], card["parent"], card["certified"]) == (name, int(number), True)
    before, after = (
        shapely.Polygon(client.get(f"{own}").json()["polygon"])
        for own in (address, f"{project}/tiles/{card['id']}")
    )
    assert before.intersection(after).area > near * before.union(after).area


def test_there_are_no_other_classes(client: Client, address: str) -> None:
    answer = client.post(f"{address}/by-hand/class", json={"name": "IH99"})
    assert (answer.status_code, "IH99" in answer.json()["error"]) == (422, True)
    assert client.post(f"{address}/by-hand/wish", json={}).status_code == 404


def test_no_tile_no_space(client: Client, address: str) -> None:
    assert client.get(f"{address}77/space").status_code == 404


STROKE = {"colour": "#d02030", "width": 0.8, "points": [[0.0, 0.0], [2.0, 1.0]]}


def test_nothing_drawn_changes_nothing(tmp_path: Path) -> None:
    tile = save_tiles([EscherTile(bent_tile("IH4", 40.0))], tmp_path / "tile")
    for nothing in ("", "{}", '{"strokes": [], "eyes": []}'):
        assert with_drawing(nothing, tile, {}, {"a": 1}, tmp_path / "s") == (tile, {}, {"a": 1})
    assert not (tmp_path / "s").exists()
    drawing = json.dumps({"strokes": [STROKE]})
    result, files, settings = with_drawing(drawing, tile, {}, {}, tmp_path / "s")
    assert files["picture"].name == "drawing.svg"
    assert settings == {}
    drawn = read_result(result)
    assert np.array_equal(drawn.tile.polygon, read_result(tile).tile.polygon)
