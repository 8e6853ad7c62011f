"""A tile that was pulled by hand tiles still, keeps its map, or is refused; its page's answers."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix

from bent_tiles import bent_tile
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.studio.other_classes import in_class
from orbiflow.studio.pulled_tiles import PullSpace, pulled, space_json
from orbiflow.studio.taking import with_drawing
from orbiflow.studio.tile_drawing import drawing_settings, with_any_map
from orbiflow.studio.tile_files import tile_folder
from orbiflow.studio.tile_view import elements_json, tile_view
from orbiflow.symmetry import Line, reflection, rotation
from orbiflow.tiles import (
    EscherTile,
    ExportSettings,
    Frame,
    Tile,
    TileMap,
    border,
    certify,
    export,
    read_over,
    read_result,
    save_tiles,
)
from orbiflow.tiles.search.bent_map import map_of_bent
from outlines import bent_squirrel
from strategies import seeds, wallpaper_groups
from studio.served import Client, house_tile
from swirled_tiles import is_sound, swirled


@cache
def squirrel(name: str, *, y_down: bool = False) -> EscherTile:
    """A tile with the map of its silhouette, in an input of its own coordinates."""
    case = bent_squirrel(name)
    linear = np.array([[40.0, 0.0], [0.0, -40.0 if y_down else 40.0]])
    frame = Frame(linear, np.array([100.0, 80.0]), size=(200.0, 160.0))
    bending = map_of_bent(case.bent, case.factor, case.shift, case.tile)
    placed = case.tile.transformed(linear, frame.offset)
    return EscherTile(placed, y_down=y_down, map_source=TileMap(frame=frame, bending=bending))


def nudged(tile: EscherTile, seed: int, reach: float) -> Array:
    """Parameters of a tile, moved at random by a share of its size that keeps sides apart."""
    space = PullSpace(tile)
    ring = space.first.polygon
    room = min(shapely.Polygon(ring).minimum_clearance, tile.tile.radius)
    rng = np.random.default_rng(seed)
    move = rng.normal(size=space.start.shape)
    return space.start + reach * room * move / abs(space.polygon(move)).max()


def test_a_pull_tells_how_far_it_is_and_can_be_ended() -> None:
    tile, heard = squirrel("IH4"), list[float]()
    given = nudged(tile, 3, 0.3)
    assert pulled(tile, given, heard.append).certificate.valid
    assert heard
    assert all(0 <= share < 1 for share in heard)

    class Ended(Exception):
        pass

    def end(_: float) -> None:
        raise Ended

    with pytest.raises(Ended):
        pulled(tile, given, end)


def test_what_lies_on_a_tile_comes_along_to_another_class() -> None:
    tile, heard = squirrel("IH4", y_down=True), list[float]()
    found = in_class(tile, "IH5", heard.append)
    assert (found.isohedral_class, found.certificate.valid) == ("IH5", True)
    assert found.bending is not None
    assert found.frame is not None
    ring = found.frame.to_input(found.bending.images)[border(found.bending.triangles)]
    outline = shapely.Polygon(found.tile.polygon)
    assert shapely.Polygon(ring).symmetric_difference(outline).area < 1e-6 * outline.area
    assert heard == sorted(heard)


@settings(max_examples=4)
@given(swirled.filter(is_sound), seeds)
def test_what_the_browser_is_told_is_the_space_of_the_tile(tile: Tile, seed: int) -> None:
    told = space_json(EscherTile(tile))
    shape = told["rows"], told["cols"]
    matrix = csr_matrix((told["values"], told["indices"], told["indptr"]), shape=shape)
    ring = np.array(told["polygon"])
    assert np.abs((matrix @ told["start"]).reshape(-1, 2) - ring).max() < 1e-9 * tile.radius
    moved = nudged(EscherTile(tile), seed, 0.3)
    after = pulled(EscherTile(tile), moved).tile.polygon
    assert np.abs(matrix @ moved - after.ravel()).max() < 1e-9
    # the body fills the tile, its first points are the vertices, and others lie on sides
    points, triangles = (np.array(told["body"][name]) for name in ("points", "triangles"))
    assert np.array_equal(points[: len(ring)], ring)
    pieces = shapely.polygons(points[triangles])
    assert shapely.area(pieces).sum() == pytest.approx(abs(tile.signed_area), rel=1e-9)
    sides = np.array(told["body"]["sides"], dtype=int).reshape(-1, 2)
    shares = np.array(told["body"]["shares"])[:, None]
    on_sides = ring[sides[:, 0]] + shares * (ring[sides[:, 1]] - ring[sides[:, 0]])
    assert np.abs(points[len(ring) :][: len(sides)] - on_sides).max(initial=0) < 1e-9 * tile.radius


@settings(max_examples=3)
@given(swirled.filter(is_sound), seeds, st.floats(0.0, 0.3))
def test_a_pulled_tile_is_certified(tile: Tile, seed: int, reach: float) -> None:
    given_tile = EscherTile(tile)
    found = pulled(given_tile, nudged(given_tile, seed, reach))
    assert found.certificate.valid
    # and can be pulled again
    assert pulled(found, nudged(found, seed + 1, reach)).certificate.valid


@pytest.mark.parametrize(("name", "y_down"), [("IH4", True), ("IH21", False)])
def test_the_map_goes_where_its_outline_went(name: str, y_down: bool, tmp_path: Path) -> None:
    tile = squirrel(name, y_down=y_down)
    before = PullSpace(tile).first.polygon
    found = pulled(tile, nudged(tile, 3, 0.4))
    after = found.tile.polygon
    assert found.map is not None
    assert found.map.ends_on(found.tile)
    # each point of the outline comes from where it came from
    assert np.abs(found.inverse(after) - tile.inverse(before)).max() < 1e-6
    share = np.random.default_rng(0).random((len(after), 1))
    between = [(1 - share) * ring + share * np.roll(ring, -1, axis=0) for ring in (before, after)]
    assert np.abs(found.inverse(between[1]) - tile.inverse(between[0])).max() < 1e-6
    assert found.likeness.fidelity is not None
    assert found.rating is not None
    loaded = read_result(save_tiles([found], tmp_path / "tile"))
    assert np.array_equal(loaded.tile.polygon, after)
    assert np.array_equal(loaded.forward(before), found.forward(before))


def test_not_pulled_is_the_same_tile_and_refusals_are_plain() -> None:
    tile = squirrel("IH4")
    start = PullSpace(tile).start
    found = pulled(tile, start)
    assert tile.bending is not None
    assert tile.frame is not None
    inside = tile.frame.to_input(tile.bending.images[tile.bending.triangles].mean(axis=1))
    assert np.abs(found.inverse(inside) - tile.inverse(inside)).max() < 1e-9
    crossed = start.copy()
    crossed[:2] += 3 * tile.tile.radius
    with pytest.raises(CertificationError, match=r"outline crosses itself there.*pull it less far"):
        pulled(tile, crossed)
    for size in (0.0, 0.1, 9.0):
        with pytest.raises(CertificationError, match=r"much too small or too large"):
            pulled(tile, size * start)
    for wrong in (start[1:], [*start[1:], np.nan], "far"):
        with pytest.raises(OrbiflowError, match="parameters of a pulled tile"):
            pulled(tile, wrong)


@settings(max_examples=6)
@given(wallpaper_groups())
def test_elements_are_one_of_each_and_belong_to_the_group(group) -> None:
    told = elements_json(group, np.zeros(2))
    places = []
    for centre in told["centres"]:
        turn = rotation(centre["at"], centre["order"])
        assert group.contains(turn)
        places.append([centre["order"], *centre["at"]])
    shares = np.array(places).reshape(-1, 3)[:, 1:] @ group.inverse_lattice.T
    apart = shares[:, None] - shares
    off = np.abs(apart - np.round(apart)).max(axis=2, initial=0) + np.eye(len(shares))
    assert np.min(off, initial=1) > 1e-3
    for line in told["mirrors"]:
        assert group.contains(reflection(Line(np.array(line["at"]), np.array(line["along"]))))
    has_glides = any(g.determinant < 0 for g in group.cosets)
    assert has_glides == bool(told["mirrors"] or told["glides"])


def test_the_view_says_where_the_silhouette_went() -> None:
    tile = squirrel("IH4", y_down=True)
    told = tile_view({}, tile)
    silhouette, track = np.array(told["silhouette_track"]), np.array(told["tile_track"])
    assert np.abs(tile.forward(silhouette) - track).max() < 1e-9
    line = shapely.LinearRing(tile.tile.polygon)
    assert shapely.distance(shapely.points(track), line).max() < 1e-9
    assert told["covered"] == [[0.0, 0.0], [200.0, 160.0]]
    bare = tile_view({}, EscherTile(tile.tile))
    assert bare["map"] is None
    assert bare["silhouette_track"] == tile.tile.polygon.tolist()


def line_across(tile: EscherTile, colour: str = "#d02030") -> dict:
    center = tile.inverse(tile.tile.polygon).mean(axis=0)
    points = center + np.linspace(-1, 1, 9)[:, None] * [4.0, 1.0]
    strokes = [{"colour": colour, "width": 1.5, "points": points.tolist()}]
    return {"strokes": strokes, "eyes": [[*center.tolist(), 2.0], [-900.0, 0.0, 2.0]]}


@pytest.mark.parametrize(("mapped", "y_down"), [(True, True), (False, False)])
def test_drawings_reach_the_export(mapped: bool, y_down: bool, tmp_path: Path) -> None:
    tile = squirrel("IH4", y_down=y_down)
    tile = tile if mapped else with_any_map(EscherTile(tile.tile, y_down=y_down))
    drawing = line_across(tile)
    filled = drawing_settings(drawing, tile, tmp_path)
    assert len(filled["eyes"]) == 1  # the other is beyond the silhouette
    settings = ExportSettings(eyes=filled["eyes"])
    export(tile, tmp_path / "out.svg", settings, picture=filled["picture"])
    assert "#d02030" in (tmp_path / "out.svg").read_text()
    motif = read_over(filled["picture"], tile).drawing
    assert motif is not None
    found = np.concatenate([curve.pieces.reshape(-1, 2) for curve in motif.parts[0].curves])
    goal = tile.forward(drawing["strokes"][0]["points"])
    line = shapely.LineString(goal)
    assert shapely.distance(shapely.points(found), line).max() < 0.02 * tile.tile.radius


def test_lines_go_over_the_artwork(tmp_path: Path) -> None:
    from PIL import Image

    tile = squirrel("IH4")
    picture = tmp_path / "art.png"
    Image.new("RGB", (400, 320), "#ffffff").save(picture)
    filled = drawing_settings(line_across(tile), tile, tmp_path, picture)
    with Image.open(filled["picture"]) as image:
        assert image.size == (400, 320)
        colours = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(int)
    for colour in ((0xD0, 0x20, 0x30), (255, 255, 255)):
        assert np.abs(colours - colour).sum(axis=1).min() < 9
    nothing = drawing_settings({}, tile, tmp_path, picture)
    assert nothing == {"picture": picture, "eyes": ()}


@pytest.mark.parametrize(
    ("drawing", "what"),
    [
        ({"strokes": 3}, "a list of strokes"),
        ({"strokes": [{"colour": "red"}]}, "colour of a line"),
        ({"strokes": [{"colour": '#fff"/><script>', "width": 1, "points": [[0, 0]]}]}, "colour"),
        ({"strokes": [{"colour": "#ffffff", "width": -1, "points": [[0, 0]]}]}, "width"),
        ({"strokes": [{"colour": "#ffffff", "width": 1, "points": [[0, "a"]]}]}, "points"),
        ({"eyes": [[1, 2]]}, "an eye"),
        ({"eyes": [[1, 2, 3]] * 100}, "too large"),
    ],
)
def test_drawings_are_checked(drawing: dict, what: str, tmp_path: Path) -> None:
    with pytest.raises(OrbiflowError, match=what):
        drawing_settings(drawing, squirrel("IH4"), tmp_path)


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


def test_a_tile_is_laid_in_another_class(client: Client, address: str) -> None:
    card = client.post(f"{address}/by-hand/class", json={"name": "IH6"}).json()
    project, number = address.split("/tiles/")
    assert (card["class_name"], card["parent"], card["certified"]) == ("IH6", int(number), True)
    addresses = address, f"{project}/tiles/{card['id']}"
    before, after = (shapely.Polygon(client.get(own).json()["polygon"]) for own in addresses)
    assert before.intersection(after).area > 0.8 * before.union(after).area


def test_there_are_no_other_classes_wishes_and_tiles(client: Client, address: str) -> None:
    answer = client.post(f"{address}/by-hand/class", json={"name": "IH99"})
    assert (answer.status_code, "IH99" in answer.json()["error"]) == (422, True)
    assert client.post(f"{address}/by-hand/wish", json={}).status_code == 404
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
