"""Solids: closed, of the right volume, mirrored where need be, and refused where they cannot be."""

from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from artworks import EYE, size_of, squirrel
from exported import tile_of, tiles
from orbiflow.drawing import read_triangles, write_3mf, write_stl
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError, SettingError
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import SolidSettings, Tile, as_tile, make_solid, polygons_in, solid_files
from orbiflow.tiles.make import ExportSettings, dark_parts, laid_out
from orbiflow.tiles.page import Curve, Motif, PathPart, Style, longer_side
from orbiflow.tiles.solids.plates import plates_of
from orbiflow.tiles.solids.shapes import Plan
from refusals import refused
from solids_read import read_3mf, read_stl, section

Kind: TypeAlias = Literal["tile", "cutter", "stamp", "mould", "puzzle"]
NEAR = 0.08  # mm: the tolerance of the curves, and of their straight sides


def in_mm(tile: Tile, size: float, *, mirrored: bool = False) -> shapely.Polygon:
    """A tile with y up, seen from above with its lower left corner at 0."""
    ring = tile.polygon * size / longer_side(tile.polygon) * (-1.0 if mirrored else 1.0, 1.0)
    return shapely.Polygon(ring - ring.min(axis=0))


def at_zero(region: Any) -> Any:
    return shapely.transform(region, lambda points: points - np.array(region.bounds[:2]))


def apart(one: Any, other: Any) -> float:
    """How much of two regions of about the same outline is in one only, as a width in mm."""
    return one.symmetric_difference(other).area / other.length


@given(tiles, st.sampled_from(get_args(Kind)))
@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_every_solid_is_closed_in_both_files(tile: Tile, kind: Kind) -> None:
    own: dict[str, Any] = {"area": (90, 90)} if kind == "puzzle" else {}
    made = make_solid(tile, SolidSettings(kind=kind, tile_size=45, **own))
    whole = read_stl(write_stl(made.parts, made.title))
    objects = read_3mf(write_3mf(made.parts, made.title))
    assert [own.name for own in objects] == list(made.parts)
    for mesh in (whole, *(own.mesh for own in objects)):
        assert mesh.is_watertight
        assert mesh.is_volume
        assert mesh.bounds[0, 2] == 0
    assert whole.volume == pytest.approx(made.volume, rel=1e-5)
    assert sum(own.mesh.volume for own in objects) == pytest.approx(made.volume, rel=1e-6)
    assert whole.extents == pytest.approx(made.size, abs=1e-4)
    assert whole.bounds[0] == pytest.approx([0, 0, 0], abs=1e-4)


@given(tiles)
@settings(max_examples=3, deadline=None)
def test_the_volume_of_a_tile(tile: Tile) -> None:
    area = in_mm(tile, 50).area
    plain = make_solid(tile, SolidSettings(height=5, chamfer=0, clearance=0))
    assert plain.volume == pytest.approx(5 * area, rel=1e-6)
    assert at_zero(section(plain.parts["tile"], 2.5)).hausdorff_distance(in_mm(tile, 50)) < NEAR
    bevelled = make_solid(tile, SolidSettings(height=5, chamfer=1, clearance=0)).parts["tile"]
    low, middle, top = (section(bevelled, z).area for z in (4 - 1e-6, 4.5, 5 - 1e-6))
    assert low == pytest.approx(area, rel=1e-6)
    # Simpson's rule is exact where the section's area is quadratic in height
    slope = (low + 4 * middle + top) / 6
    assert bevelled.volume() == pytest.approx(4 * area + slope, rel=1e-3)
    inset = section(plain.parts["tile"], 1).buffer(-1, quad_segs=32)
    assert top == pytest.approx(inset.area, rel=2e-3)


@pytest.mark.parametrize("kind", ["cutter", "stamp", "mould"])
def test_what_prints_from_its_other_side_is_mirrored(kind: Kind) -> None:
    tile = tile_of("IH4")
    exact: dict[str, Any] = {"clearance": 0} if kind == "mould" else {}
    body = make_solid(tile, SolidSettings(kind=kind, tile_size=60, **exact)).parts[kind]
    shape = section(body, 1.0 if kind == "stamp" else body.bounding_box()[5] - 1e-6)
    if kind != "stamp":
        (shape,) = (shapely.Polygon(ring) for ring in shape.interiors)
    shape = at_zero(shape)
    assert shape.hausdorff_distance(in_mm(tile, 60, mirrored=True)) < NEAR
    assert apart(shape, in_mm(tile, 60)) > 0.5


@pytest.mark.parametrize(
    "given",
    [
        *({"chamfer": 4}, {"kind": "mould", "draft": 0}, {"kind": "mould", "relief": 8}),
        *({"kind": "cutter", "blade": 5, "wall": 5}, {"kind": "stamp", "wall": 90}),
    ],
)
def test_extremes(given: dict[str, Any]) -> None:
    made = make_solid(tile_of("IH4"), SolidSettings(**given))
    (own,) = read_3mf(write_3mf(made.parts))
    assert own.mesh.is_volume


def test_a_cutter_s_walls() -> None:
    own = SolidSettings(kind="cutter", wall=1.5, blade=0.5, foot=6, floor=3, height=9)
    body = make_solid(tile_of("IH6"), own).parts["cutter"]
    hole = shapely.Polygon(section(body, 1).interiors[0])
    for z, width in [(1.5, 6), (4, 1.5), (8.9, 1.5), (10.5, 1.0), (12 - 1e-6, 0.5)]:
        wall = section(body, z)
        assert shapely.Polygon(wall.interiors[0]).symmetric_difference(hole).area < 1e-6
        outer = shapely.Polygon(wall.exterior)
        assert outer.hausdorff_distance(hole) == pytest.approx(width, abs=0.03)
        assert outer.exterior.distance(hole) == pytest.approx(width, abs=0.03)


def test_a_mould_casts_the_tile() -> None:
    tile, own = (
        tile_of("IH5"),
        SolidSettings(kind="mould", clearance=0, draft=10, height=6, floor=3),
    )
    body = make_solid(tile, own).parts["mould"]
    for depth, distance in [(0, 0), (3, 3 * own.slope), (6 - 1e-6, 6 * own.slope)]:
        cavity = shapely.Polygon(section(body, 9 - 1e-6 - depth).interiors[0])
        mouth = shapely.Polygon(section(body, 9 - 1e-6).interiors[0])
        assert apart(cavity, mouth.buffer(-distance)) < 0.02
    assert not section(body, 2.9).interiors
    assert mouth.exterior.distance(section(body, 1).exterior) == pytest.approx(4, abs=0.01)


@pytest.mark.parametrize("relief", [1.0, 6.0])
def test_a_drawing_stands_on_the_mould_s_floor(relief: float) -> None:
    own = SolidSettings(kind="mould", height=6, relief=relief)
    page = ExportSettings(cut="pieces", tile_size=own.tile_size)
    placed, _ = laid_out(as_tile(tile_of("IH5")), page)
    disc = shapely.Point(placed.page.tiling.center).buffer(4)
    body = plates_of([Plan(own, placed, disc)])[0]["mould"].solid
    (island,) = (p for p in polygons_in(section(body, 2 + relief / 2)) if not p.interiors)
    assert island.area == pytest.approx(disc.area)
    assert len(polygons_in(section(body, 2 + relief + 1e-3))) == (1 if relief < 6 else 0)
    assert read_3mf(write_3mf({"mould": body}))[0].mesh.is_volume


@pytest.mark.parametrize(("name", "border"), [("IH4", "following"), ("IH5", "straight")])
def test_a_puzzle_s_pieces_lie_in_the_tray(
    name: str, border: Literal["straight", "following"]
) -> None:
    tile = tile_of(name)
    own = SolidSettings(kind="puzzle", copies=5, tray_border=border, clearance=0.3, assembled=True)
    made = make_solid(tile, own)
    tray, *pieces = made.parts.values()
    assert len(pieces) == 5
    assert all(piece.volume() == pytest.approx(pieces[0].volume()) for piece in pieces)
    assert all((tray ^ piece).volume() == pytest.approx(0, abs=1e-9) for piece in pieces)
    wall, *plans = (section(body, 2.5) for body in (tray, *pieces))
    gaps = [plan.distance(other) for k, plan in enumerate(plans) for other in [wall, *plans[:k]]]
    assert min(gaps) == pytest.approx(0.3, abs=2e-3)
    assert min(plan.distance(wall) for plan in plans) == pytest.approx(0.3, abs=2e-3)
    # the tray holds nothing but the pieces and the gaps around them
    room = shapely.union_all(plans).buffer(0.31)
    inside = shapely.Polygon(section(tray, 1).exterior).difference(wall)
    assert inside.difference(room).area < 0.01 * inside.area


def test_a_puzzle_s_pieces_lie_apart_on_the_bed() -> None:
    made = make_solid(tile_of("IH5"), SolidSettings(kind="puzzle", copies=5, area=(110, 110)))
    tray, *others = made.plates
    assert list(tray) == ["tray"]
    assert [name for plate in others for name in plate] == [f"piece {k}" for k in range(1, 6)]
    for plate in made.plates:
        boxes = np.array([own.solid.bounding_box() for own in plate.values()])
        assert (boxes[:, 3:5].max(axis=0) <= 110).all()
        assert boxes[:, :3].min(axis=0) == pytest.approx([0, 0, 0], abs=1e-9)
        plans = [shapely.box(*box[[0, 1, 3, 4]]) for box in boxes]
        gaps = [a.distance(b) for k, a in enumerate(plans) for b in plans[:k]]
        assert min(gaps, default=3) > 2.9
        assert set(boxes[:, 2]) == {0.0}
    assert [len(read_3mf(content)) for content in solid_files(made, "3mf")] == [
        len(plate) for plate in made.plates
    ]
    own = SolidSettings(kind="puzzle", copies=5, area=(110, 110), assembled=True)
    laid = make_solid(tile_of("IH5"), own)
    assert len(laid.plates) == 1
    assert made.volume == pytest.approx(laid.volume)


def test_a_tray_keeps_to_the_area() -> None:
    own = SolidSettings(kind="puzzle", area=(100, 130), tile_size=30, assembled=True)
    made = make_solid(tile_of("IH4"), own)
    assert (made.size[:2] <= (100, 130)).all()
    assert len(made.parts) > 6
    with refused(f"{len(made.parts) - 1} pieces", "30 mm", 99):
        make_solid(tile_of("IH4"), own.replace(copies=99))


def test_dark_lines_stand_out_and_light_ones_do_not() -> None:
    tile = squirrel("IH4")
    own = SolidSettings(kind="stamp", tile_size=80, eyes=((*EYE, 12.0),), relief=2)
    body = make_solid(tile, own).parts["stamp"]
    scale = 80 / longer_side(tile.tile.polygon)
    ring = tile.tile.polygon * (-scale, -scale)
    x, y = tile.forward(np.array(EYE)) * (-scale, -scale) - ring.min(axis=0)
    face, base, eye = section(body, 4), section(body, 2), shapely.Point(x, y)
    assert face.contains(eye)  # the pupil
    assert 0.2 < face.intersection(eye.buffer(2)).area / eye.buffer(2).area < 0.7
    border = base.difference(base.buffer(-1))
    assert border.difference(face).area < 1e-3
    assert face.difference(border.union(eye.buffer(3))).area < 1e-3


def test_what_is_raised() -> None:
    def disc(radius: float, colour: str, opacity: float = 1.0) -> PathPart:
        ring = shapely.get_coordinates(shapely.Point(0, 0).buffer(radius))[:-1]
        return PathPart((Curve.polyline(ring, closed=True),), Style(colour), opacity)

    line = PathPart((Curve.polyline([[20, 0], [30, 0]]),), Style(None, "currentColor", 0.1))
    eye = disc(5, "#202020"), disc(3, "#fff0e0"), disc(1, "#000000"), disc(9, "#000000", 0.3)
    areas = sorted(part.area for part in polygons_in(dark_parts(Motif((*eye, line)), 0.4)[0]))
    assert areas == pytest.approx([np.pi, 10 * 0.4 + np.pi * 0.2**2, 16 * np.pi], rel=0.01)


@pytest.mark.parametrize(("fill", "said"), [("#333333", True), ("#eeeeee", False)])
def test_a_drawing_that_is_dark_all_over_is_said_to_show_nothing(
    tmp_path: Path, fill: str, said: bool
) -> None:
    width, height = size_of(squirrel("IH4"))
    path = tmp_path / "dark.svg"
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">'
        f'<rect width="{width}" height="{height}" fill="{fill}"/></svg>'
    )
    made = make_solid(squirrel("IH4"), SolidSettings(kind="stamp"), picture=path)
    assert any("the drawing is dark all over" in note for note in made.notes) == said


def test_notes_say_where_it_is_too_thin() -> None:
    """A bar with a slit 1 mm wide and a neck 2 mm wide."""
    ring = [[0, 0], [20, 0], [20, 8], [40, 8], [40, 0], [60, 0], [60, 10], [31, 10], [31, 30]]
    ring += [[60, 30], [60, 40], [0, 40], [0, 30], [30, 30], [30, 10], [0, 10]]
    tile = Tile(np.array(ring, float), wallpaper_group("p1", np.diag([80.0, 60.0])))
    size = longer_side(tile.polygon)
    with refused("force", kind=CertificationError):
        make_solid(tile, SolidSettings(kind="cutter"))
    made = make_solid(tile, SolidSettings(kind="cutter", tile_size=size), force=True)
    assert made.title.startswith("NOT CERTIFIED")
    (note,) = (note for note in made.notes if "thinner than 5 mm: a neck" in note)
    assert "is 1.00 mm wide" in note
    quiet = SolidSettings(kind="cutter", tile_size=size, warn_neck=0)
    assert "thinner" not in " ".join(make_solid(tile, quiet, force=True).notes)


@pytest.mark.parametrize(
    ("given", "least"),
    [
        *(({}, 2 * 0.5 + 0.2), ({"chamfer": 1, "clearance": 0}, 2.0), ({"nozzle": 2}, 2.0)),
        *(({"kind": "cutter"}, 5.0), ({"kind": "stamp"}, 0.4), ({"kind": "mould"}, 2.0)),
        ({"kind": "mould", "height": 20}, 40 * np.tan(np.radians(5))),
        ({"kind": "puzzle", "clearance": 0.4}, 1.4),
        ({"kind": "cutter", "warn_neck": "3mm"}, 3.0),
    ],
)
def test_how_thin_a_solid_may_be(given: dict[str, Any], least: float) -> None:
    assert SolidSettings(**given).warn_neck == pytest.approx(least)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "puzzle", "clearance": 0}, "clearance must be above 0"),
        ({"chamfer": 5}, "chamfer must be at most height, 4 mm"),
        ({"kind": "mould", "relief": 9}, "relief must be at most height"),
        ({"kind": "cutter", "blade": 2}, "blade must be at most wall, and wall at most foot"),
        ({"kind": "cutter", "chamfer": 1}, "chamfer applies only to kind"),
        ({"blade": 1}, "blade applies only to kind cutter"),
        ({"kind": "cutter", "engrave": True}, "engrave has no place on a cutter"),
        ({"relief": 5}, "relief must be at most height"),
        ({"fit_test": True}, "fit_test applies only to kind puzzle"),
        ({"kind": "vase"}, "kind must be"),
    ],
)
def test_settings_that_cannot_be(given: dict[str, Any], words: str) -> None:
    with pytest.raises(SettingError, match=words):
        SolidSettings(**given)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"tile_size": 2, "chamfer": 3}, "nothing is left of the tile"),
        ({"kind": "mould", "tile_size": 10, "draft": 40}, "nothing is left of the tile"),
        ({"tile_size": 2, "clearance": 1.9}, "clearance of 1.9 mm is wider than the piece's neck"),
        ({"kind": "puzzle", "area": (30, 30)}, "does not fit"),
    ],
)
def test_solids_that_cannot_be(given: dict[str, Any], words: str) -> None:
    with pytest.raises(OrbiflowError, match=words):
        make_solid(tile_of("IH4"), SolidSettings(**given))


def test_a_stamp_wants_lines(tmp_path: Path) -> None:
    tile, picture = squirrel("IH4"), tmp_path / "photo.png"
    Image.new("RGB", size_of(tile, 60)).save(picture)
    with refused("photo.png", "SVG", kind=InputFileError):
        make_solid(tile, SolidSettings(kind="stamp"), picture=picture)
    with refused("picture", "cutter"):
        make_solid(tile, SolidSettings(kind="cutter"), picture=picture)


@pytest.mark.parametrize("kind", ["tile", "puzzle"])
def test_a_drawing_is_sunk_and_filled_in_a_second_colour(kind: Literal["tile", "puzzle"]) -> None:
    given: dict[str, Any] = {"kind": kind, "tile_size": 60, "relief": 0.8, "clearance": 0.1}
    given |= {"copies": 2} if kind == "puzzle" else {}
    plain = make_solid(squirrel("IH4"), SolidSettings(**given))
    made = make_solid(squirrel("IH4"), SolidSettings(**given, eyes=((*EYE, 12.0),)))
    bodies = {name: own for plate in made.plates for name, own in plate.items()}
    for name, own in bodies.items():
        if name == "tray":
            assert own.inlay is None
            continue
        assert own.inlay is not None
        both = own.solid + own.inlay
        assert both.volume() == pytest.approx(plain.parts[name].volume(), rel=1e-6)
        assert (own.solid ^ own.inlay).volume() == pytest.approx(0, abs=1e-6)
        box = own.inlay.bounding_box()
        assert (box[2], box[5]) == pytest.approx((3.2, 4.0))
        assert section(own.inlay, 3.6).area > 1
    for plate, content in zip(made.plates, solid_files(made, "3mf"), strict=True):
        objects = read_3mf(content)
        assert all(own.mesh.is_volume for own in objects)
        # slicers drop each object on the bed: what fills a drawing is in that of its piece
        assert len(objects) == len(plate)
    # without a second colour it is sunk
    first = make_solid(squirrel("IH4"), SolidSettings(kind="tile", eyes=((*EYE, 12.0),)))
    whole = read_stl(solid_files(first, "stl")[0])
    assert whole.is_volume
    assert whole.volume == pytest.approx(first.volume, rel=1e-5)


def test_a_fit_test_has_two_neighbours_at_five_clearances() -> None:
    own = SolidSettings(kind="puzzle", clearance=0.2, tile_size=50, fit_test=True)
    made = make_solid(tile_of("IH5"), own)
    assert len(made.parts) == 10
    assert any("clearances of 0.1, 0.15, 0.2, 0.3 and 0.4 mm" in note for note in made.notes)
    for number, clearance in enumerate((0.1, 0.15, 0.2, 0.3, 0.4), 1):
        pair = [body for name, body in made.parts.items() if name.startswith(f"pair {number}")]
        alone = make_solid(tile_of("IH5"), SolidSettings(tile_size=50, clearance=clearance))
        for body in pair:
            low = section(body, 1.0)
            assert low.area == pytest.approx(section(alone.parts["tile"], 1.0).area, rel=1e-4)
            top = section(body, 3.7)
            assert len(top.interiors) == number


@pytest.mark.parametrize(("kind", "name"), [("tile", "a.stl"), ("puzzle", "a.3mf")])
def test_files_are_read_again_to_be_drawn(kind: Kind, name: str, tmp_path: Path) -> None:
    own: dict[str, Any] = {"area": (90, 90)} if kind == "puzzle" else {}
    made = make_solid(tile_of("IH4"), SolidSettings(kind=kind, **own))
    (tmp_path / name).write_bytes(solid_files(made, name[2:])[0])
    parts = read_triangles(tmp_path / name)
    bodies = [own.solid for own in made.plates[0].values()]
    assert len(parts) == len(bodies)
    for part, body in zip(parts, bodies, strict=True):
        first, second, third = part.transpose(1, 0, 2)
        volume = np.einsum("ij,ij->i", first, np.cross(second, third)).sum() / 6
        assert volume == pytest.approx(body.volume(), rel=1e-4)


def test_files_are_the_same_every_time() -> None:
    tile = as_tile(tile_of("IH4"))
    for form in ("stl", "3mf"):
        (once,) = solid_files(make_solid(tile), form)
        assert solid_files(make_solid(tile), form) == [once]
        assert not once.startswith(b"solid")
    with refused("format", "obj", kind=SettingError):
        solid_files(make_solid(tile), "obj")
