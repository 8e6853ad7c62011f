"""Parts of a silhouette that must not bend: spots and masks."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from mask_files import SIZE, picture, save
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles import Pins, Target
from orbiflow.tiles.silhouette import outside, triangulate
from outlines import animal, bar
from refusals import refused

SQUIRREL = animal("squirrel.dat")


def half_mask(folder: Path) -> Path:
    mask = Image.new("L", SIZE, 0)
    ImageDraw.Draw(mask).rectangle((0, 0, 59, 99), fill=255)
    return save(folder, mask)


def test_a_mask_holds_what_is_white(tmp_path: Path) -> None:
    target = picture(tmp_path)
    pins = Pins.read([half_mask(tmp_path)], target)
    points = [[25, 15], [55, 50], [65, 50], [170, 80]]
    assert pins.holds(target.to_normal(points)).tolist() == [True, True, False, False]
    assert pins.report()["sources"] == [str(tmp_path / "mask.png")]


def test_spots_and_masks_together(tmp_path: Path) -> None:
    target = picture(tmp_path)
    pins = Pins.read([half_mask(tmp_path), "170, 80,12", "1.7e2,20"], target, keep_angle=True)
    points = [[25, 15], [170, 85], [170, 55], [170, 12]]
    assert pins.holds(target.to_normal(points)).tolist() == [True, True, False, True]
    assert pins.keep_angle
    # of 160 units, 8% are 12.8; the outline is 10 away, but for the pixels' slant, times 1.5
    assert pins.spots[:, 2] * np.sqrt(target.area) == pytest.approx([12, 15], abs=1)


def test_a_spot_inside_reaches_the_outline() -> None:
    target = Target.from_polygon(bar(10, 4))
    pins = Pins.at(target, [(5, 2)])
    assert pins.holds(target.to_normal([[5, 0], [5, 4]])).all()
    inside = Pins.at(target, [(5, 2, 0.5)])
    assert any("keeps its shape there" in note for note in inside.notes)


def test_a_small_pin_inside_holds_the_triangle_around_it(tmp_path: Path) -> None:
    target = picture(tmp_path)
    mesh = triangulate(target.normal, 0.2)
    middle = mesh.points[mesh.triangles[np.argmin(np.hypot(*mesh.points.T)[mesh.triangles].sum(1))]]
    x, y = target.to_input(middle.mean(axis=0))
    dot = Image.new("L", SIZE, 0)
    ImageDraw.Draw(dot).ellipse((x - 2, y - 2, x + 2, y + 2), fill=255)
    for pins in (Pins.at(target, [(x, y, 1)]), Pins.read([save(tmp_path, dot)], target)):
        assert not pins.holds(mesh.points).any()
        (part,) = pins.parts(mesh.points, mesh.triangles)
        assert set(part) in [set(own) for own in mesh.triangles]


def test_each_connected_part_is_one() -> None:
    mesh = triangulate(SQUIRREL.normal)
    ends = SQUIRREL.outline[[0, 30]]
    parts = Pins.at(SQUIRREL, ends).parts(mesh.points, mesh.triangles)
    assert len(parts) == 2
    near = Pins.at(SQUIRREL, [ends[0], ends[0] + 10]).parts(mesh.points, mesh.triangles)
    assert len(near) == 1
    assert Pins.at(SQUIRREL, ends).holds(mesh.points[np.concatenate(parts)]).all()


@pytest.mark.parametrize(
    ("spots", "message"),
    [
        ([(0, 0)], r"the pin at 0,0 lies outside the silhouette, .* spans x from 114 to 781"),
        ([(300, 650, 20)], "lies outside the silhouette"),
        ([(300, 300, 0)], "the radius of a pin must be above 0, got 0"),
        ([(300, 300, -5)], "the radius of a pin must be above 0, got -5"),
        ([(300,)], "a pin must be x,y or x,y,radius, got 1 numbers"),
        ([(1, 2, 3, 4)], "a pin must be x,y or x,y,radius, got 4 numbers"),
        ([(np.nan, 2)], "a pin.*finite"),
        ([], "no pin was given"),
        ([(450, 450, 5000)], "100.0% of the outline"),
    ],
)
def test_mistakes(spots: list, message: str) -> None:
    with pytest.raises(OrbiflowError, match=message):
        Pins.at(SQUIRREL, spots)


def test_mistakes_of_masks(tmp_path: Path) -> None:
    target = picture(tmp_path)
    with refused("nowhere.png", kind=InputFileError):
        Pins.read(["nowhere.png"], target)
    corner = Image.new("L", SIZE, 0)
    ImageDraw.Draw(corner).rectangle((0, 0, 5, 5), fill=255)
    with refused("mask.png", kind=InputFileError):
        Pins.read([save(tmp_path, corner)], target)
    with refused("12;80", kind=InputFileError):
        Pins.read(["12;80"], target)


@given(st.floats(-2000, 2000), st.floats(-2000, 2000))
def test_the_place_that_a_refused_pin_is_told_lies_inside(x: float, y: float) -> None:
    squirrel = shapely.Polygon(SQUIRREL.outline)
    place = str(outside("the pin", x, y, squirrel)).split()[-1].split(",")
    assert squirrel.contains(shapely.Point(*map(float, place)))
