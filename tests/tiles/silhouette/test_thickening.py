"""Local thickness; thin parts grow to a width, bodies and gaps stay; too thin ones are said at once."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import Target, polygons_in, resampled
from orbiflow.tiles.silhouette import ReadingSettings, doubts, triangulate
from outlines import bar, comb, disc, dumbbell
from refusals import refused

FOLDER = Path(__file__).parents[3] / "examples" / "silhouettes"


def legged(legs: list[list[tuple[float, float]]], width: float) -> shapely.Polygon:
    """A round body with legs, each a line of a width from its middle."""
    body = shapely.Point(0, 0).buffer(40)
    lines = [shapely.LineString([(0, 0), *leg]).buffer(width / 2) for leg in legs]
    (whole,) = polygons_in(shapely.union_all([body, *lines]))
    return shapely.Polygon(whole.exterior)


def target_of(shape: shapely.Polygon) -> Target:
    return Target.from_polygon(shapely.get_coordinates(shape.exterior)[:-1])


def spider(width: float, count: int = 8) -> Target:
    turns = 2 * np.pi * (np.arange(count) + 0.3) / count
    legs = [
        [(80 * np.cos(t), 80 * np.sin(t)), (160 * np.cos(t + 0.2), 160 * np.sin(t + 0.2))]
        for t in turns
    ]
    return target_of(legged(legs, width))


def thinnest_across(target: Target, radius: float) -> float:
    """The least length of a circle's arcs that lie in a silhouette about the origin."""
    ring = shapely.Point(0, 0).buffer(radius, quad_segs=200).exterior
    arcs = shapely.get_parts(shapely.line_merge(ring.intersection(shapely.Polygon(target.outline))))
    return float(shapely.length(arcs).min())


@given(st.floats(1, 9), st.integers(3, 9), st.floats(0.03, 0.05))
def test_legs_grow_to_the_width_and_none_is_lost(width: float, count: int, share: float) -> None:
    target = spider(width, count)
    grown = target.thickened(share)
    asked = share * float(np.ptp(target.outline, axis=0).max())
    assert thinnest_across(grown, 130) > 0.95 * max(asked, width)
    assert thinnest_across(grown, 60) > 0.95 * max(asked, width)
    own, more = shapely.Polygon(target.outline), shapely.Polygon(grown.outline)
    assert more.is_valid
    assert own.difference(more).area < 2e-3 * own.area
    assert more.difference(own.buffer(0.51 * asked)).area < 1e-3 * own.area
    circle = shapely.Point(0, 0).buffer(130, quad_segs=200).exterior
    assert len(shapely.get_parts(shapely.line_merge(circle.intersection(more)))) == count


@given(st.floats(0.02, 0.1))
def test_what_is_wide_enough_stays(share: float) -> None:
    box = Target.from_polygon([[0, 0], [9, 0], [9, 5], [4, 5], [4, 9], [0, 9]])
    np.testing.assert_array_equal(box.thickened(share).outline, box.outline)
    assert box.thickened(0.0) is box


@given(st.floats(6, 30))
def test_gaps_stay_open(gap: float) -> None:
    """Two legs side by side whose ends nearly meet keep the space that they enclose."""
    out = 100.0
    legs = [[(out, 60), (out + 60, gap / 2 + 3)], [(out, -60), (out + 60, -gap / 2 - 3)]]
    target = target_of(legged(legs, 4))
    grown = shapely.Polygon(target.thickened(0.08).outline)
    assert not grown.contains(shapely.Point(out, 0))
    assert not grown.contains(shapely.Point(out + 55, 0))


def test_fur_does_not_grow() -> None:
    turns = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    radius = 100 + 8 * (np.arange(400) % 2)
    furry = Target.from_polygon(np.column_stack([radius * np.cos(turns), radius * np.sin(turns)]))
    grown = shapely.Polygon(furry.thickened(0.04).outline)
    assert grown.area < 1.01 * furry.area


def test_growing_is_said_and_comes_before_smoothing() -> None:
    target = spider(4)
    grown = ReadingSettings(thicken=0.04, smooth=0.03).shaped(target)
    assert grown.notes[-2].startswith("grew parts thinner than 4.0% of the length, by ")
    assert thinnest_across(grown, 130) > 0.035 * 300
    with refused("thicken"):
        ReadingSettings(thicken=0.3)


def test_what_has_grown_in_a_picture_outlasts_smoothing() -> None:
    mask = np.zeros((300, 400), dtype=bool)
    mask[90:210, 40:200] = True
    mask[145:149, 200:360] = True  # a leg
    mask[20:60, 20:60] = True  # apart from the rest
    target = Target.from_mask(mask)
    assert target.seen is not None
    grown = ReadingSettings(thicken=0.06, smooth=0.03).shaped(target)
    assert grown.outline.max(axis=0)[0] > 350
    assert ReadingSettings(smooth=0.03).shaped(target).outline.max(axis=0)[0] < 250


def test_legs_that_are_too_thin_are_said_before_a_search() -> None:
    (said,) = doubts(spider(4))
    assert "let them grow (--thicken) by 0.04" in said.named(lambda name: f"--{name}")
    assert "let them grow (thicken) by 0.04" in said
    assert not doubts(spider(4).thickened(0.04))
    assert not doubts(spider(30))
    for file in FOLDER.rglob("*.*"):
        if file.suffix in (".dat", ".svg", ".png"):
            assert "(thicken)" not in " ".join(doubts(Target.read(file))), file


def test_a_thread_can_be_grown() -> None:
    thread = Target.from_polygon([[0, 0], [200, 0], [200, 4], [0, 4]])
    assert "(thicken) by 0.1" in " ".join(doubts(thread))
    assert not doubts(thread.thickened(0.1))


def thickness(ring: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """At the triangles' middles, with these."""
    mesh = triangulate(resampled(ring, count))
    return mesh.points[mesh.triangles].mean(axis=1), mesh.local_thickness


def test_a_disc_is_as_thick_everywhere() -> None:
    _, found = thickness(disc(200), 120)
    assert found == pytest.approx(np.pi**-0.5, rel=0.01)


@settings(max_examples=6)
@given(st.floats(0.1, 0.5), st.floats(-3, 3))
def test_a_bar_has_half_its_width(width: float, turn: float) -> None:
    ring = bar(1 / width, width)
    middle, found = thickness(ring @ rotation_matrix(turn).T, 240)
    middle = middle @ rotation_matrix(turn)
    inside = (middle[:, 0] > width / 2) & (middle[:, 0] < 1 / width - width / 2)
    assert found[inside] == pytest.approx(width / 2, rel=0.03)
    assert found.max() <= width / 2 + 1e-12
    assert (found > 0).all()


def test_the_teeth_of_a_comb_are_thin_and_its_back_is_not() -> None:
    middle, found = thickness(comb(3, 0.2, 0.4, 1.0, back=0.8), 400)
    teeth = (middle[:, 1] > 0.9) & (middle[:, 1] < 1.65)  # not the corners of the ends
    assert found[teeth].max() <= 0.1 + 1e-12
    assert found[teeth].min() > 0.09
    back = (abs(middle[:, 0] - 0.7) < 0.3) & (middle[:, 1] < 0.6)
    assert found[back] == pytest.approx(0.4, rel=0.1)


def test_a_neck_is_thinner_than_what_it_joins() -> None:
    middle, found = thickness(dumbbell(0.1, 1.0), 600)
    neck = (middle[:, 0] > 1.1) & (middle[:, 0] < 1.9)
    assert found[neck].min() > 0.04
    assert found[neck].max() <= 0.05 + 1e-12
    heart = np.hypot(middle[:, 0] - 0.5, middle[:, 1] - 0.5) < 0.4
    assert found[heart] == pytest.approx(0.5, rel=0.05)
