"""The way of a project through the server: from an upload to what is taken away."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from orbiflow.errors import OrbiflowError
from orbiflow.studio.silhouette_file import load_target
from orbiflow.studio.tile_files import tile_number
from orbiflow.studio.words import is_outdated
from orbiflow.tiles import Emphasis, Pins, certify, read_result
from studio.served import (
    SQUARE,
    Client,
    done,
    house_project,
    join_tasks,
    new_project,
    put_card,
    studio,
    worked,
)


@pytest.fixture(scope="module")
def project(client: Client) -> str:
    """A project with a silhouette and a tile."""
    address = house_project(client)
    put_card(client, address, tile_number(900, 0))
    return address


def test_about(client: Client) -> None:
    about = client.get("/api/about").json()
    assert len(about["animals"]) >= 8
    for animal in about["animals"]:
        picture = client.get(animal["picture"])
        if animal["picture"].endswith("svg"):
            assert picture.content.startswith(b"<svg")
        else:
            assert max(Image.open(io.BytesIO(picture.content)).size) == 384
    assert set(about["palettes"][0]) == {"name", "colours", "shades", "outline", "paper"}


def test_an_eye_that_is_a_hole_is_something_to_see(client: Client) -> None:
    address, fish = new_project(client), "M10 50Q40 10 80 50L95 35V65L80 50Q40 90 10 50Z"
    for eye, coloured in (("", False), ("M30 40h8v8h-8z", True)):
        drawing = f'<path fill-rule="evenodd" d="{fish}{eye}"/>'
        svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{drawing}</svg>'
        done(client, client.put(f"{address}/input?name=fish.svg", content=svg.encode()))
        assert client.get(address).json()["silhouette"]["coloured"] is coloured


def oval(ground: Any, *inks: Any) -> Image.Image:
    """An oval of one colour, or of two beside each other, on a ground."""
    picture = ground if isinstance(ground, Image.Image) else Image.new("RGB", (240, 160), ground)
    ImageDraw.Draw(picture).ellipse((50, 40, 190, 120), fill=inks[0])
    ImageDraw.Draw(picture).chord((50, 40, 190, 120), 90, 270, fill=inks[-1])
    return picture


def test_only_what_can_hardly_be_misread_is_clear(client: Client) -> None:
    meadow = Image.merge(
        "RGB",
        [Image.linear_gradient("L").resize((240, 160))] * 2 + [Image.new("L", (240, 160), 90)],
    )
    two, edge = oval("white", "black"), oval("white", "black")
    ImageDraw.Draw(two).ellipse((5, 5, 40, 30), fill="black")
    ImageDraw.Draw(edge).rectangle((0, 60, 240, 160), fill="black")
    cases = {
        "one colour": (oval("white", "black"), True),
        "cut out": (oval(Image.new("RGBA", (240, 160)), "red", "blue"), True),
        "two colours": (oval("white", "red", "blue"), False),
        "photograph": (oval(meadow, "brown"), False),
        "a part left out": (two, False),
        "hardly any border": (edge, False),
    }
    for case, (picture, is_clear) in cases.items():
        address, file = new_project(client), io.BytesIO()
        picture.save(file, "PNG")
        done(client, client.put(f"{address}/input?name=oval.png", content=file.getvalue()))
        silhouette = client.get(address).json()["silhouette"]
        assert silhouette["clear"] is is_clear, case


@pytest.mark.parametrize("name", ["turtle", "frog", "barbet"])
def test_an_animal_that_was_drawn_is_one_shape_with_something_in_it(client, name: str) -> None:
    address = new_project(client)
    done(client, client.post(f"{address}/animal", json={"name": name}))
    own = client.get(address).json()["silhouette"]
    assert own["coloured"]
    assert own["doubts"] == []
    assert own["left_out"] == []


def test_an_upload_becomes_a_silhouette(client: Client, project: str) -> None:
    found = client.get(project).json()
    assert found["name"] == "house"
    assert found["input"] == {"name": "house.json", "type": "json"}
    own = found["silhouette"]
    # y points up in the file and down on the screen
    assert own["height"] / own["width"] == pytest.approx(90 / 80, abs=0.01)
    assert sorted(own["outline"])[-1][1] in (own["height"], pytest.approx(own["height"] / 3, abs=1))
    backdrop = Image.open(io.BytesIO(client.get(own["backdrop"]).content))
    assert backdrop.size == (own["width"], own["height"])
    assert backdrop.getpixel((own["width"] // 2, own["height"] // 2)) == (70, 78, 92)
    (summary,) = (one for one in client.get("/api/projects").json() if one["name"] == "house")
    assert summary["thumb"].endswith("backdrop.png")


def test_a_polygon_stays_in_its_picture_when_it_is_mended(client: Client) -> None:
    address = house_project(client)
    before = client.get(address).json()["silhouette"]
    size = before["width"], before["height"]
    brush = Image.new("RGBA", size)
    ImageDraw.Draw(brush).rectangle((0, 0, size[0] // 2, size[1]), fill=(0, 0, 0, 255))
    done(client, client.put(f"{address}/mend", content=painted(brush)))
    found = client.get(address).json()["silhouette"]
    low, high = np.min(found["outline"], axis=0), np.max(found["outline"], axis=0)
    assert (found["width"], found["height"]) == size
    assert low == pytest.approx([size[0] / 2, 0], abs=3)
    assert high == pytest.approx(size, abs=3)


def test_what_is_refused_is_in_the_pages_words(client: Client) -> None:
    address, picture = new_project(client), Image.new("L", (90, 90), 255)
    picture.paste(250, (20, 20, 50, 50))
    task = done(client, client.put(f"{address}/input?name=my cat.png", content=painted(picture)))
    assert task["state"] == "failed"
    assert task["error"].startswith("my cat.png: the image is all but blank")
    assert task["error"].endswith("try another edge (Where it ends)")
    answer = client.put(f"{address}/reading", json={"smooth": 7})
    assert answer.json()["error"].startswith("smoothing must be")


@pytest.mark.parametrize("mask", ["pins", "emphasis"])
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(radius=st.sampled_from([0, 1, 2, 4, 8, 30, 120, 2000]), at=st.tuples(*[st.floats(0, 1)] * 2))
def test_what_a_search_would_not_take_is_said_where_it_is_painted(
    client: Client, project: str, mask: str, radius: int, at: tuple[float, float]
) -> None:
    own = client.get(project).json()["silhouette"]
    size = own["width"], own["height"]
    x, y = np.array(at) * size
    brush = Image.new("L", size)
    ImageDraw.Draw(brush).ellipse((x - radius, y - radius, x + radius, y + radius), fill=255)
    refused = client.put(f"{project}/{mask}", content=painted(brush)).json()["refused"]
    home = client.studio.store.home(project.split("/")[-1])
    target = load_target(home)
    read = {"pins": lambda: Pins.read([home / "pins.png"], target)}.get(
        mask, lambda: Emphasis.read(home / "emphasis.png", target)
    )
    if refused:
        with pytest.raises(OrbiflowError):
            read()
        body = {"operation": "search", "settings": {"effort": "fast", "classes": ["IH4"]}}
        answer = client.post(f"{project}/tasks", json=body)
        assert (answer.status_code, answer.json()["error"]) == (422, refused)
    else:
        read()
    assert client.delete(f"{project}/{mask}").json() == {"mask": None, "refused": ""}


def painted(shape: Any) -> bytes:
    data = io.BytesIO()
    shape.save(data, "png")
    return data.getvalue()


def test_a_silhouette_is_mended_by_brush(client: Client) -> None:
    address = new_project(client)
    picture = Image.new("L", (400, 300), 255)
    ImageDraw.Draw(picture).rectangle((100, 100, 299, 199), fill=0)
    done(client, client.put(f"{address}/input?name=a.png", content=painted(picture)))
    before = np.array(client.get(address).json()["silhouette"]["outline"])
    brush = Image.new("RGBA", (400, 300))
    ImageDraw.Draw(brush).rectangle((280, 100, 349, 199), fill="white")
    ImageDraw.Draw(brush).rectangle((100, 100, 149, 199), fill="black")
    done(client, client.put(f"{address}/mend", content=painted(brush)))
    found = client.get(address).json()
    after = np.array(found["silhouette"]["outline"])
    assert before[:, 0].min() == pytest.approx(100, abs=1)
    assert after[:, 0].min() == pytest.approx(150, abs=1)
    assert after[:, 0].max() == pytest.approx(350, abs=1)
    assert found["mend"]
    done(client, client.delete(f"{address}/mend"))
    again = np.array(client.get(address).json()["silhouette"]["outline"])
    np.testing.assert_allclose(again, before)


def test_reading_can_be_set_and_a_new_picture_begins_anew(client: Client) -> None:
    address = new_project(client)
    assert client.put(f"{address}/reading", json={"smooth": 0.01}).status_code == 422
    done(client, client.put(f"{address}/input?name=a.json", content=SQUARE))
    assert client.put(f"{address}/reading", json={"smooth": 7}).status_code == 422
    backdrop = client.get(address).json()["silhouette"]["backdrop"]
    done(client, client.put(f"{address}/reading", json={"threshold": None, "smooth": 0.1}))
    found = client.get(address).json()
    assert found["silhouette"]["backdrop"] == backdrop  # what stays is not loaded again
    usual = {"threshold": None, "invert": None, "thicken": 0.0}
    assert found["reading"] == {**usual, "smooth": 0.1}
    assert len(found["silhouette"]["outline"]) > 10
    done(client, client.post(f"{address}/animal", json={"name": "bat"}))
    found = client.get(address).json()
    assert found["reading"]["smooth"] == 0.0
    assert found["silhouette"]["width"] == 384
    assert client.post(f"{address}/animal", json={"name": "../x"}).status_code == 404


def test_a_new_picture_ends_the_search_of_the_old_one(tmp_path: Path) -> None:
    with studio(tmp_path) as client:
        client.studio.queue.slots["long"] = 0  # it waits
        address = new_project(client)
        done(client, client.put(f"{address}/input?name=a.json", content=SQUARE))
        client.post(f"{address}/tasks", json={"operation": "search"})
        done(client, client.post(f"{address}/animal", json={"name": "bat"}))
        states = {t["operation"]: t["state"] for t in client.get(address).json()["tasks"]}
        assert states == {"read": "done", "search": "cancelled"}


SMALL = {"area": "80x60mm"}


@pytest.mark.parametrize(
    ("operation", "settings", "name"),
    [
        ("export", {**SMALL, "cut": "skeleton"}, "house-skeleton-40mm.svg"),
        ("export", {**SMALL, "purpose": "laser", "cut": "jigsaw"}, "house-laser-jigsaw-40mm.svg"),
        ("export", {**SMALL, "purpose": "print"}, "house-print-40mm.pdf"),
        ("art", {"area": "60x40px"}, "house-picture.png"),
        ("art", {"area": "60x40px", "format": "svg"}, "house-picture.svg"),
        ("solid", {"kind": "stamp"}, "house-stamp.stl"),
        ("animate", {"kind": "grow", "seconds": 0.5, "fps": 2, "area": "96x64px"}, "house.gif"),
    ],
)
def test_what_is_taken_away(
    client: Client, project: str, operation: str, settings: dict[str, Any], name: str
) -> None:
    task = worked(client, project, operation, tile=tile_number(900, 0), **settings)
    assert task["state"] == "done", task["error"]
    (file,) = task["result"]["files"]
    assert file["name"] == name
    address = f"/api/takeaways/{task['id']}"
    answer = client.get(f"{address}/files/{file['name']}")
    assert len(answer.content) == file["bytes"]
    assert answer.headers["content-disposition"].startswith("attachment")
    assert "sandbox" in answer.headers["content-security-policy"]
    seen = client.get(f"{address}/preview.png")
    assert seen.status_code == (200 if task["result"]["preview"] else 404)
    assert task["result"]["preview"] or operation == "animate" or name.endswith("svg")
    assert client.get(f"{address}/files/other.svg").status_code == 404


def test_a_tile_that_is_gone_cannot_be_taken_away(client: Client, project: str) -> None:
    tile = put_card(client, project, tile_number(901, 0))["id"]
    assert client.get(f"{project}/tiles/{tile}").json()["id"] == tile
    assert client.delete(f"{project}/tiles/{tile}").status_code == 200
    assert client.get(f"{project}/tiles/{tile}").status_code == 404
    assert "no such tile" in worked(client, project, "export", tile=tile)["error"]


def test_views_are_merged_and_no_answer_names_a_folder(client: Client, project: str) -> None:
    tab = {"X-Orbiflow-Client": "tab one"}
    client.patch(project, json={"view": {"a": 1, "b": {"c": 2}}}, headers=tab)
    client.patch(project, json={"view": {"b": 3}, "name": "a/b\n"}, headers=tab)
    found = client.get(project).json()
    assert found["view"] == {"a": 1, "b": 3}
    assert found["name"] == "b"
    paths = (project, "/api/projects", "/api/about", f"{project}/tiles/{tile_number(900, 0)}")
    for path in paths:
        assert str(client.studio.store.folder) not in client.get(path).text


def test_a_project_goes_into_a_file_and_comes_back(client: Client, project: str) -> None:
    client.patch(project, json={"view": {"zoom": 2}})
    answer = client.get(f"{project}/file")
    assert answer.headers["content-disposition"].endswith('.orbiflow"')
    opened = client.post("/api/projects/open", content=answer.content).json()
    address = f"/api/projects/{opened['id']}"
    join_tasks()
    one, other = client.get(project).json(), client.get(address).json()
    for name in ("name", "view", "input", "reading"):
        assert one[name] == other[name]
    for name in ("outline", "width", "height"):
        assert one["silhouette"][name] == other["silhouette"][name]
    (before,), (after,) = one["tiles"], other["tiles"]
    assert after == {**before, "id": after["id"], "found_for": [other["silhouette"]["mark"]]}
    folder = client.studio.store.home(opened["id"]) / "tiles" / str(after["id"]) / "final" / "tile"
    assert certify(read_result(folder).tile).valid


def test_tiles_of_an_outline_since_mended_are_known_as_such_in_a_file_too(client: Client) -> None:
    address = house_project(client)
    store, name = client.studio.store, address.split("/")[-1]
    mark = client.get(address).json()["silhouette"]["mark"]
    card = put_card(client, address, tile_number(901, 0), found_for=[mark])
    assert not is_outdated(card, store.project(name))

    def saved_and_opened() -> dict[str, Any]:
        content = client.get(f"{address}/file").content
        opened = client.post("/api/projects/open", content=content).json()["id"]
        join_tasks()
        return client.get(f"/api/projects/{opened}").json()

    same = saved_and_opened()
    assert not is_outdated(same["tiles"][0], same)
    done(client, client.put(f"{address}/reading", json={"smooth": 0.05}))
    assert is_outdated(card, store.project(name))
    mended = saved_and_opened()
    assert is_outdated(mended["tiles"][0], mended)


@pytest.mark.parametrize("content", [SQUARE, b"PK", b""])
def test_a_file_that_is_no_project_leaves_none_behind(client: Client, content: bytes) -> None:
    store = client.studio.store
    before = store.summaries()
    answer = client.post("/api/projects/open", content=content)
    assert answer.status_code == 422
    assert answer.json()["error"].startswith(("this file: not a project", "the file is empty"))
    assert store.summaries() == before
    assert {path.name for path in store.folder.glob("projects/*")} == {one["id"] for one in before}
