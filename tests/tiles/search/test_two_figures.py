"""Tiles of two figures: found, measured, saved, drawn, cut, printed and animated as those of one."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from artworks import pixels_of
from exported import scenes, svg_lines
from orbiflow.errors import InputFileError, OrbiflowError, SettingError
from orbiflow.runtime import Cancel, Event, Preview, TileFound
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import (
    AnimationSettings,
    ArtSettings,
    EscherizeSettings,
    EscherTile,
    ExportSettings,
    LikenessSearch,
    Over,
    SolidSettings,
    artwork,
    colouring,
    complex_points,
    copies_meeting,
    dirichlet_tiling,
    escherize,
    fidelity,
    make_solid,
    read_result,
    report,
    save_tiles,
    signed_area,
    write_run,
    write_scene,
)
from orbiflow.tiles.likeness import mixing_factor
from orbiflow.tiles.motifs import CarriedPicture
from orbiflow.tiles.motion.kinds import motion
from orbiflow.tiles.result_file import part_file
from orbiflow.tiles.tilings import mixing
from outlines import animal
from refusals import refused
from small_pairs import NAMES, pair_result, small_pairs
from strategies import seeds
from tiles.exporting.conftest import hasty_nesting

DOCS = Path(__file__).parents[3] / "docs"


def pair() -> EscherTile:
    return pair_result().tiles[0]


def test_both_figures_are_measured_and_the_worse_one_ranks() -> None:
    found = pair_result()
    assert found.tiles
    assert [tile.score for tile in found.tiles] == sorted(
        (t.score for t in found.tiles), reverse=True
    )
    for tile in found.tiles:
        assert tile.certificate.valid
        assert tile.rating == tile.worst.rating
        worst = min(part.figure.score for part in tile.figures)
        assert tile.score == pytest.approx(worst * mixing_factor(mixing(tile.tiling)))
        for part, target in zip(tile.figures, found.targets, strict=True):
            assert part.figure.likeness.metrics.iou > 0.5
            assert part.figure.silhouette == target.report()
            assert part.figure.rating is not None


@given(seeds, st.integers(0, 1))
def test_maps_of_both_figures_have_inverses(seed: int, number: int) -> None:
    figure = pair().figures[number].figure
    rng = np.random.default_rng(seed)
    low, high = figure.silhouette_outline.min(axis=0), figure.silhouette_outline.max(axis=0)
    points = rng.uniform(low, high, (20, 2))
    inside = shapely.contains_xy(shapely.Polygon(figure.silhouette_outline), *points.T)
    moved = figure.forward(points[inside])
    size = float(np.ptp(figure.tile.polygon))
    polygon = shapely.Polygon(figure.tile.polygon).buffer(1e-9 * size)
    assert shapely.contains_xy(polygon, *moved.T).all()
    np.testing.assert_allclose(figure.inverse(moved), points[inside], atol=1e-6 * size)


@pytest.mark.parametrize("number", [0, 1])
def test_maps_keep_what_the_marks_say(number: int) -> None:
    figure = pair().figures[number].figure
    known = figure.likeness.fidelity
    assert known is not None
    rest, frame = figure.likeness.rest, figure.frame
    assert rest is not None
    assert frame is not None
    rest = frame.to_normal(rest)
    moved = frame.to_normal(figure.forward(frame.to_input(rest)))
    way = 1 if signed_area(rest) > 0 else -1
    kept = fidelity(complex_points(rest)[::way], complex_points(moved)[::way], known.cost)
    assert kept.mark == pytest.approx(known.mark, abs=0.1)


def test_a_saved_pair_is_the_same(tmp_path: Path) -> None:
    folder = save_tiles([pair()], tmp_path / "run")
    again = read_result(folder)
    assert again.certificate.valid
    for own, read in zip(pair().figures, again.figures, strict=True):
        np.testing.assert_array_equal(own.figure.tile.polygon, read.figure.tile.polygon)
        np.testing.assert_array_equal(own.place.linear, read.place.linear)
        assert read.figure.bending is not None
        point = own.figure.silhouette_outline[0]
        np.testing.assert_array_equal(own.figure.forward(point), read.figure.forward(point))
        assert read.figure.rating == own.figure.rating
    save_tiles([pair()], folder)  # its own files may be replaced
    assert (folder / pair().name / part_file("model.safetensors", 1)).is_file()


def _edited(folder: Path, edit: str) -> Path:
    file = folder / "result.json"
    document = json.loads(file.read_text())
    entry = document["tiles"][0]["parts"][0]
    if edit == "vertex":
        middle = _on_path(entry["polygon"], document["tiles"][0]["polygon"])
        entry["polygon"][middle][0] += 1e-6 * float(np.ptp(np.array(entry["polygon"])[:, 0]))
    if edit == "size":
        entry["place"]["linear"] = (2 * np.array(entry["place"]["linear"])).tolist()
    if edit == "place":
        entry["place"] = {"linear": [[0, 0], [0, 0]], "offset": [0, 0]}
    file.write_text(json.dumps(document))
    return folder


def _on_path(part: list[list[float]], union: list[list[float]]) -> int:
    """Return a vertex of a part, in the whole's coordinates, that is none of the whole's outline."""
    line = shapely.LinearRing(union)
    away = [line.distance(shapely.Point(point)) for point in part[1:-1]]
    return 1 + int(np.argmax(away))


def test_a_vertex_of_the_path_that_moved_is_refused(tmp_path: Path) -> None:
    folder = _edited(save_tiles([pair()], tmp_path / "run"), "vertex")
    assert not read_result(folder).certificate.valid


@pytest.mark.parametrize("edit", ["size", "place"])
def test_parts_that_are_none_are_refused(tmp_path: Path, edit: str) -> None:
    with refused("result.json", "tile 1", kind=InputFileError):
        read_result(_edited(save_tiles([pair()], tmp_path / "run"), edit))


@given(seeds, st.sampled_from(["p1", "p2", "pg", "pgg", "p3", "p4", "pm"]))
def test_prototiles_have_colours_of_their_own(seed: int, name: str) -> None:
    group = wallpaper_group(name)
    points = np.random.default_rng(seed).random((2, 2)) @ group.lattice.T
    try:
        tiling = dirichlet_tiling(group, list(points))
    except OrbiflowError:  # two points near a mirror or centre may be one
        return
    colours = colouring(tiling)
    assert sum(colours.shares) == colours.count
    copies = copies_meeting(tiling, (-1.0, -1.0, 1.5, 1.5))
    numbers, kinds = colours.colours(copies), copies.prototiles
    first, second = (set(numbers[kinds == k].tolist()) for k in (0, 1))
    assert not first & second


def _flat(figure: EscherTile, colour: str) -> Over:
    return Over(CarriedPicture(Image.new("RGBA", (40, 40), colour), figure.covered))


def test_each_figure_carries_its_own_picture() -> None:
    tile = pair()
    overs = [
        _flat(p.figure, colour) for p, colour in zip(tile.figures, ("red", "blue"), strict=True)
    ]
    given: dict[str, Any] = {"area": "300x200px", "tile_size": "90px", "outline": "none"}
    settings = ArtSettings(**given)
    pixels = pixels_of(artwork(tile, settings, *overs)).reshape(-1, 3)
    red, blue = ((pixels == colour).all(axis=1).mean() for colour in ([255, 0, 0], [0, 0, 255]))
    area = [abs(own.signed_area) for own in tile.tiling.prototiles]
    assert red + blue > 0.85
    assert red / (red + blue) == pytest.approx(area[0] / sum(area), abs=0.06)


def test_a_second_picture_needs_a_second_figure() -> None:
    one = pair().figures[0].figure
    with refused("second_picture", kind=SettingError):
        artwork(one, ArtSettings(), None, _flat(one, "red"))
    with refused("second_eyes", kind=SettingError):
        artwork(one, ArtSettings(second_eyes=((1.0, 1.0),)))


@pytest.mark.parametrize("cut", ["none", "skeleton", "pieces", "jigsaw", "template"])
def test_every_cut_has_both_figures(cut: str) -> None:
    settings = ExportSettings(cut=cut, tile_size="30mm", area="80x60mm")  # pyright: ignore[reportArgumentType]
    with hasty_nesting():
        sheets, _ = scenes(pair(), settings)
    tiles = [tile.prototile for sheet in sheets for tile in sheet.tiles]
    assert set(tiles) == {0, 1}
    assert all(write_scene(sheet, form) for sheet in sheets for form in ("svg", "dxf", "json"))
    if cut == "pieces":
        assert [{tile.prototile for tile in sheet.tiles} for sheet in sheets] == [{0}, {1}]
        assert len(svg_lines(str(write_scene(sheets[1], "svg")))) == len(sheets[1].tiles)


def test_a_file_for_programs_names_prototiles() -> None:
    sheets, _ = scenes(pair(), ExportSettings(area=(200.0, 150.0)))
    document = json.loads(write_scene(sheets[0], "json"))
    assert len(document["prototiles"]) == 2
    for tile in document["tiles"]:
        for near in tile["neighbours"]:
            assert tile["number"] in document["tiles"][near]["neighbours"]


@pytest.mark.parametrize("kind", ["tile", "cutter", "stamp", "mould", "puzzle"])
def test_solids_of_both_figures(kind: str) -> None:
    made = make_solid(pair(), SolidSettings(kind=kind))  # pyright: ignore[reportArgumentType]
    bodies = list(made.parts.values())
    assert len(bodies) == 2 if kind != "puzzle" else len(bodies) > 3
    for k, body in enumerate(bodies):
        assert body.volume() > 0
        for other in bodies[:k] if kind != "puzzle" else ():
            assert (body ^ other).volume() == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("kind", ["morph", "grow", "bend"])
def test_every_frame_of_a_morph_is_a_tiling(kind: str) -> None:
    moving = motion(pair(), AnimationSettings(kind=kind, area="300x200px"))  # pyright: ignore[reportArgumentType]
    window = shapely.box(60, 40, 240, 160)
    for progress in (0.0, 0.4, 1.0) if kind == "morph" else (1.0,):
        rings = [shapely.Polygon(own.ring) for own in moving.seen(progress)]
        assert all(ring.is_valid for ring in rings)
        covered = sum(ring.intersection(window).area for ring in rings)
        assert covered == pytest.approx(window.area, rel=1e-4)
        assert shapely.union_all(rings).intersection(window).area == pytest.approx(
            window.area, rel=1e-4
        )


def test_a_search_that_is_stopped_keeps_its_first_look() -> None:
    cancel, events = Cancel(), list[Event]()

    def tell(event: Event) -> None:
        events.append(event)
        if isinstance(event, Preview):
            cancel.cancel()

    one, two = map(animal, NAMES)
    with small_pairs():
        settings = EscherizeSettings(effort="fast")
        found = escherize(one, settings, second=two, on_event=tell, cancel=cancel)
    assert len(found.tiles) == 1
    assert found.interrupted == {found.tiles[0].isohedral_class}
    assert [event for event in events if isinstance(event, TileFound)]


def test_pins_and_masks_of_either_figure_count() -> None:
    one, two = map(animal, NAMES)
    x, y = two.outline[0]
    settings = EscherizeSettings(effort="fast", second_pin=(f"{x},{y}",))
    with small_pairs():
        found = escherize(one, settings, second=two)
    assert found.second is not None
    assert found.second.pins is not None
    assert all(tile.certificate.valid for tile in found.tiles)


def test_two_silhouettes_are_searched_for_likeness() -> None:
    one, two = map(animal, NAMES)
    with refused("objective", "method", kind=SettingError):
        escherize(one, EscherizeSettings(objective="overlap"), second=two)
    with refused("second"):
        escherize(one, second=two, method=LikenessSearch())
    with refused("IH12", kind=SettingError), small_pairs():
        escherize(one, EscherizeSettings(effort="fast", classes=("IH12",)), second=two)


@pytest.mark.parametrize("text", ["0", "3-2", "x", "1-", "0.01-1", "1.2.3"])
def test_ratios_that_are_none_are_refused(text: str) -> None:
    with refused("ratio", kind=SettingError):
        EscherizeSettings(ratio=text)  # pyright: ignore[reportArgumentType]


def test_a_background_may_have_any_shape(tmp_path: Path) -> None:
    with small_pairs():
        settings = EscherizeSettings(effort="fast", background=True)
        found = escherize(animal(NAMES[0]), settings)
    assert found.targets == (found.target,)
    best = found.tiles[0]
    figure, left = best.figures
    assert best.certificate.valid
    assert left.is_background
    assert best.worst is figure.figure
    assert figure.figure.score > pair().worst.score  # any shape is easier than another animal
    folder = write_run(found, tmp_path / "run")[0].parents[1]
    again = read_result(folder)
    assert [part.is_background for part in again.figures] == [False, True]
    assert not list(folder.rglob("overlay-2.png"))
    point = left.figure.tile.polygon.mean(axis=0)
    np.testing.assert_allclose(
        again.figures[1].figure.forward(point), point, atol=1e-9 * np.ptp(point)
    )
    assert (
        len(make_solid(again, SolidSettings(clearance=0, chamfer=0)).parts) == 2
    )  # necks are narrow
    jsonschema.validate(
        json.loads(json.dumps(report(found))), json.loads((DOCS / "result.schema.json").read_text())
    )


def test_a_background_takes_the_second_silhouettes_place() -> None:
    one, two = map(animal, NAMES)
    with refused("background", kind=SettingError):
        escherize(one, EscherizeSettings(background=True), second=two)
