"""Two pictures in one project: read, searched, saved, pulled and taken away together."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.sparse import csr_matrix

from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import Event, ItemDone
from orbiflow.studio import open_project, tasks
from orbiflow.studio.pulled_tiles import PullSpace, pulled, space_json
from orbiflow.studio.settings import Job, SearchChoice
from orbiflow.studio.taking import with_drawing
from orbiflow.studio.tasks import read, search
from orbiflow.studio.tile_files import best_stage, tile_folder
from orbiflow.studio.tile_view import tile_card, tile_view
from orbiflow.studio.words import is_outdated
from orbiflow.tiles import EscherTile, colouring, read_result, save_tiles
from outlines import FOLDER
from small_pairs import NAMES, pair_result, small_pairs
from strategies import seeds
from studio.served import SQUARE, Client, done, house_project, new_project, put_card, worked
from studio.test_pull_module import FOLLOW, run_in_node

BOOT = b"[[0, 0], [60, 0], [60, 20], [30, 25], [28, 70], [0, 70]]"


@pytest.fixture(scope="module", name="pair")
def pair_fixture() -> EscherTile:
    return pair_result().tiles[0]


@pytest.fixture(name="home")
def home_fixture(tmp_path: Path) -> Path:
    """The folder of a project with two pictures."""
    for number, (end, name) in enumerate(zip(("", "-2"), NAMES, strict=True)):
        (tmp_path / f"input{end}.dat").write_bytes((FOLDER / name).read_bytes())
        read(Job(project=tmp_path, task=1), name, number=number)
    return tmp_path


def mask() -> bytes:
    """A mask that adds a block to a picture."""
    data = io.BytesIO()
    Image.new("RGBA", (400, 400), (255, 255, 255, 255)).save(data, "PNG")
    return data.getvalue()


def test_each_picture_is_read_as_its_own_settings_and_masks_say(client: Client) -> None:
    address = house_project(client)
    done(client, client.put(f"{address}/input?name=boot.json&number=1", content=BOOT))
    before = client.get(address).json()
    assert (before["name"], before["second"]["input"]["name"]) == ("house", "boot.json")
    done(client, client.put(f"{address}/reading?number=1", json={"smooth": 0.05}))
    done(client, client.put(f"{address}/mend?number=1", content=mask()))
    found = client.get(address).json()
    assert found["silhouette"] == before["silhouette"]
    assert found["second"]["reading"]["smooth"] == 0.05
    outlines = [own["second"]["silhouette"]["outline"] for own in (before, found)]
    assert shapely.Polygon(outlines[1]).area > 1.2 * shapely.Polygon(outlines[0]).area
    backdrop = client.get(found["second"]["silhouette"]["backdrop"])
    assert backdrop.headers["content-type"] == "image/png"
    done(client, client.delete(f"{address}/mend?number=1"))
    assert client.get(address).json()["second"]["mend"] is None
    client.delete(f"{address}/second")
    gone = client.get(address).json()
    assert gone == {**gone, "second": None, "silhouette": before["silhouette"]}
    assert not list(client.studio.store.home(address.split("/")[-1]).glob("*-2.*"))
    for path in ("input?number=2", "reading?number=1", "mend?number=1", "mend?number=-1"):
        assert client.put(f"{address}/{path}", content=b"{}").status_code in (404, 422)


def test_the_same_picture_again_is_read_and_mended_alike(client: Client) -> None:
    address = new_project(client)
    assert client.post(f"{address}/second").status_code == 422
    done(client, client.put(f"{address}/input?name=house.json", content=SQUARE))
    done(client, client.put(f"{address}/reading", json={"smooth": 0.05}))
    done(client, client.put(f"{address}/mend", content=mask()))
    done(client, client.post(f"{address}/animal?number=1", json={"name": "bat"}))
    assert done(client, client.post(f"{address}/second"))["operation"] == "read second"
    found = client.get(address).json()
    assert found["second"]["silhouette"]["outline"] == found["silhouette"]["outline"]
    assert found["second"]["reading"] == found["reading"]


def run(home: Path, **choice: Any) -> tuple[dict[str, Any], list[tuple[int, str]]]:
    """Search; return what came of it and the stages of tiles in order."""
    seen = list[tuple[int, str]]()

    def watch(event: Event) -> None:
        if isinstance(event, ItemDone):
            number, stage = event.name.split("/")
            seen.append((int(number), stage))

    wanted = SearchChoice(effort="fast", **choice)
    with small_pairs():
        found = search(Job(project=home, task=5), wanted, on_event=watch)
    return found.summary, seen


def test_tiles_of_a_stage_replace_those_before(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "cores", lambda: 1)
    summary, seen = run(home)
    count = summary["tiles"]
    assert seen[0] == (5000, "sketch")
    assert [own for own in seen if own[1] == "final"] == [(5000 + k, "final") for k in range(count)]
    numbers = {number for number, _ in seen}
    assert set(summary["gone"]) == {number for number in numbers if number >= 5000 + count}
    for number in numbers - set(summary["gone"]):
        tile = read_result(tile_folder(home, number))
        assert (len(tile.figures), tile.certificate.valid) == (2, True)
    assert all(best_stage(home, number) is None for number in summary["gone"])
    with pytest.raises(OrbiflowError, match="look alike"):
        run(home, objective="overlap")


def test_what_matters_in_each_picture_goes_into_the_search(home: Path) -> None:
    for name in ("emphasis", "emphasis-2", "pins-2"):
        Image.new("L", (10, 10), 255).save(home / f"{name}.png")
    own = tasks._search_settings(home, SearchChoice()).to_json()  # pyright: ignore[reportPrivateUsage]
    names = ("emphasis", "pin", "second_emphasis", "second_pin")
    given = [own.get(name) for name in names]
    paths = [str(home / f"{name}.png") for name in ("emphasis", "emphasis-2", "pins-2")]
    assert given == [paths[0], None, paths[1], [paths[2]]]


def test_a_card_has_both_figures_and_their_colours(pair: EscherTile) -> None:
    card = tile_card(pair, 1, "final")
    assert len(card["figures"]) == 2
    colours = colouring(pair.tiling)
    for own, part in zip(card["figures"], pair.figures, strict=True):
        placed = part.prototile.polygon
        assert np.abs(np.array(own["polygon"]) - placed).max() < 1e-5 * np.abs(placed).max()
        assert own["stars"] == part.figure.rating.stars  # pyright: ignore[reportOptionalMemberAccess]
    assert card["colours"]["shares"] == list(colours.shares)
    assert len(card["group"]["figures"]) == len(card["group"]["cosets"]) == len(colours.table)
    for own, part in zip(tile_view(card, pair)["figures"], pair.figures, strict=True):
        a, b, c, d, e, f = own["place"]
        rest = np.array(own["map"]["rest"])
        there = np.stack([a * rest[:, 0] + c * rest[:, 1] + e, b * rest[:, 0] + d * rest[:, 1] + f])
        assert np.allclose(there.T, part.place(rest))
        ends = part.place(part.figure.forward(rest))
        assert np.abs(np.array(own["map"]["images"]) - ends).max() < 1e-9 * np.abs(ends).max()


def saved(client: Client, home: Path, pair: EscherTile) -> bytes:
    """A project's file with two pictures and a tile of both."""
    address = new_project(client)
    for number, file in enumerate(("backdrop.png", "backdrop-2.png")):
        query, content = f"name={file}&number={number}", (home / file).read_bytes()
        done(client, client.put(f"{address}/input?{query}", content=content))
    put_card(client, address, 7000, pair)
    return client.get(f"{address}/file").content


def test_a_project_of_two_is_saved_opened_and_taken_away(client, home, pair, tmp_path) -> None:
    content = saved(client, home, pair)
    (tmp_path / "both.orbiflow").write_bytes(content)
    project = open_project(tmp_path / "both.orbiflow")
    assert project.second is not None
    assert project.second.source == "backdrop-2.png"
    assert len(project.tiles[0].figures) == 2
    own = client.post("/api/projects/open", content=content).json()
    assert own["second"]["silhouette"]["outline"]
    assert own["second"]["input"] == {"name": "backdrop-2.png", "type": "png"}
    address = f"/api/projects/{own['id']}"
    eye, line = [[0.0, 0.0, 1.0]], {"colour": "#d02030", "width": 0.8}
    figure = pair.figures[1].figure
    middle = figure.silhouette_outline.mean(axis=0)
    drawn = {**line, "points": [middle.tolist(), (middle + 1).tolist()]}
    view = {"drawing": {"strokes": [], "eyes": eye, "second": {"strokes": [drawn], "eyes": []}}}
    client.patch(address, json={"view": view})
    wishes: list[tuple[str, dict[str, Any]]] = [
        ("export", {"purpose": "web", "drawing": True}),
        ("art", {"area": "300x200px", "picture": True, "drawing": True}),
        ("solid", {"kind": "stamp"}),
        ("animate", {"kind": "bend", "seconds": 0.5, "fps": 4, "area": "120x80px"}),
    ]
    texts = list[bytes]()
    for operation, wish in wishes:
        task = worked(client, address, operation, tile=own["tiles"][0]["id"], **wish)
        assert task["state"] == "done", task["error"]
        name = task["result"]["files"][0]["name"]
        texts.append(client.get(f"/api/takeaways/{task['id']}/files/{name}").content)
    assert b"#d02030" in texts[0]


def test_what_is_drawn_on_either_figure_goes_to_it(pair: EscherTile, tmp_path: Path) -> None:
    folder = save_tiles([pair], tmp_path / "tile")
    outlines = [shapely.Polygon(part.figure.silhouette_outline) for part in pair.figures]
    one, two = ([*own.representative_point().coords[0], 1.0] for own in outlines)
    stroke = {"colour": "#d02030", "width": 1.0, "points": [two[:2], one[:2]]}
    drawing = json.dumps({"eyes": [one], "second": {"strokes": [stroke], "eyes": [two]}})
    result, files, given_settings = with_drawing(drawing, folder, {}, {}, tmp_path / "drawn")
    assert result == folder
    assert [name.name for name in files.values()] == ["drawing-2.svg"]
    assert list(files) == ["second_picture"]
    assert given_settings == {"eyes": (tuple(one),), "second_eyes": (tuple(two),)}


@settings(max_examples=3, deadline=None)
@given(seeds, st.floats(0.0, 0.3))
def test_a_pulled_pair_is_certified_and_keeps_both_maps(seed: int, reach: float) -> None:
    pair = pair_result().tiles[0]
    space = PullSpace(pair)
    told = space_json(pair)
    shape = told["rows"], told["cols"]
    matrix = csr_matrix((told["values"], told["indices"], told["indptr"]), shape=shape)
    assert np.abs(matrix @ space.start - space.points.ravel()).max() < 1e-9 * pair.tile.radius
    # the body fills both figures
    points, triangles = (np.array(told["body"][name]) for name in ("points", "triangles"))
    areas = shapely.area(shapely.polygons(points[triangles]))
    assert areas.sum() == pytest.approx(abs(pair.tile.signed_area), rel=1e-9)
    room = min(shapely.Polygon(space.points[ring]).minimum_clearance for ring in space.rings)
    move = np.random.default_rng(seed).normal(size=space.start.shape)
    moved = space.start + reach * room * move / np.abs(space.polygon(move)).max()
    found = pulled(pair, moved)
    assert found.certificate.valid
    for part, ring in zip(found.figures, space.rings, strict=True):
        ends = space.polygon(moved)[ring]
        assert np.abs(part.prototile.polygon - ends).max() < 1e-9 * pair.tile.radius
        assert part.figure.map is not None
        assert part.figure.map.ends_on(part.figure.tile)
        assert part.figure.rating is not None
    assert pulled(found, PullSpace(found).start).certificate.valid
    moved[-len(space.outline.maps) - 4] += 3 * pair.tile.radius  # of the path
    with pytest.raises(CertificationError, match="crosses itself"):
        pulled(pair, moved)


def test_the_browser_pulls_the_path_between_two_figures(pair: EscherTile) -> None:
    space = space_json(pair)
    ring, outer = np.array(space["rings"][0]), space["outer"]
    path = np.flatnonzero(ring >= outer)
    share = float(path[len(path) // 2] + 0.5) / len(space["polygon"])
    pulls = [{"share": share, "by": [0.04, 0.03]}, {"share": share, "by": [1.0, 0.2]}]
    near, far = run_in_node(FOLLOW, {"space": space, "pulls": pulls})
    assert near["moved"] > 0.02
    assert far["stopped"]
    for answer in (near, far):
        points = np.array(answer["polygon"]).reshape(-1, 2)
        assert np.abs(points[:outer] - space["polygon"][:outer]).max() < 0.3 * pair.tile.radius
        assert pulled(pair, answer["parameters"]).certificate.valid


OUTDATED = """
import { isOutdated } from "MODULES/../words.js";
const cases = JSON.parse((await import("node:fs")).readFileSync(0));
console.log(JSON.stringify(cases.map(([card, project]) => isOutdated(card, project))));
"""


def test_a_tile_of_a_pair_is_of_an_earlier_picture_once_the_second_is_removed() -> None:
    """The server and the browser say the same."""

    def picture(mark: str | None) -> dict[str, Any]:
        return {"silhouette": mark and {"mark": mark}}

    pair, single, drawn = {"found_for": ["a", "b"]}, {"found_for": ["a"]}, dict[str, Any]()
    cases = [
        (pair, None, True),
        (pair, picture("b"), False),
        (pair, picture("c"), True),
        (pair, picture(None), False),  # it is being read
        (single, None, False),
        (single, picture("b"), False),
        (drawn, None, False),
    ]
    given = [(card, {**picture("a"), "second": second}) for card, second, _ in cases]
    expected = [is_old for *_, is_old in cases]
    assert [is_outdated(*case) for case in given] == expected
    assert run_in_node(OUTDATED, given) == expected
