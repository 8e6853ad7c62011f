"""Other worlds: maps agree with mpmath, edges match, copies cover, pages are as asked for."""

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial import KDTree

from orbiflow.arrays import Array
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles import ArtSettings, EscherTile, art, orient, signed_area
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.worlds import (
    Unfolding,
    colours,
    copies,
    facing,
    unfolded,
    world_of,
    world_scene,
)
from orbiflow.tiles.worlds.curved import disc_of, form
from orbiflow.tiles.worlds.outlines import with_points
from orbiflow.tiles.worlds.sheet import TOLERANCE
from refusals import refused
from small_pairs import pair_result
from swirled_tiles import is_sound, swirled_tile

ROUND = {"IH7": "p3", "IH28": "p4", "IH21": "p6"}
ORDERS: dict[str, list[tuple[int, ...]]] = {
    **{name: [(3, 3, 4), (2, 4, 5), (2, 3, 7), (4, 4, 4)] for name in ROUND},
    "IH4": [(2, 2, 2, 3), (2, 2, 3, 4), (5, 5, 5, 5)],
    **{name: [(2, 3), (3, 4)] for name in ("IH5", "IH6")},
    **{name: [(2,), (3,)] for name in ("IH1", "IH2", "IH3")},
}


def sound(classes: Any) -> Any:
    return st.builds(
        swirled_tile, st.sampled_from(list(classes)), st.integers(0, 999), st.floats(0.0, 0.4)
    ).filter(is_sound)


tiles = sound(ROUND)
SPHERES = {(2, 3, 3): 12, (2, 3, 4): 24, (2, 3, 5): 60, (2, 2, 5): 10}


def world(tile: Any, orders: Any) -> Unfolding:
    return unfolded(EscherTile(tile).tiling, orders)


def area(found: Unfolding) -> float:
    """The area of the polygon with straight sides through the outline's vertices."""
    ring = found.vectors(found.ring)
    one, two = ring, np.roll(ring, -1, axis=0)
    apex, diagonal = found.middle, form(found.sign)
    volume = np.linalg.det(np.stack([np.broadcast_to(apex, one.shape), one, two], axis=1))
    dots = [(a * diagonal * b).sum(axis=-1) for a, b in ((apex, one), (one, two), (two, apex))]
    # the angle's excess, or what it lacks: tan of half the area
    return float(abs(2 * np.arctan2(volume, 1 + found.sign * sum(dots)).sum()))


@settings(max_examples=3)
@given(sound(ORDERS), st.data())
def test_edges_match_and_areas_add_up(tile: Any, data: Any) -> None:
    name = tile.isohedral_class
    spheres = [*SPHERES] if name in ROUND else []
    orders = data.draw(st.sampled_from([*spheres, *ORDERS[name]]))
    found = world(tile, orders)
    ring, diagonal = found.vectors(found.ring), form(found.sign)
    big = np.abs(ring).max() ** 2
    assert np.abs((ring * diagonal * ring).sum(axis=1) - found.sign).max() < 1e-11 * big
    around: Any = np.einsum("eij,nj->eni", found.neighbours, ring).reshape(-1, 3)
    apart = np.asarray(KDTree(around).query(ring)[0])
    assert apart.max() < 1e-9 * big
    excess = abs(2 - sum(1 - 1 / own for own in found.development.orders))
    # the pattern has half-turns that translations alone have not, and lacks glides
    share = {"IH1": 2, "IH2": 2, "IH3": 2, "IH5": 1 / 2, "IH6": 1 / 2}.get(name, 1)
    assert area(found) == pytest.approx(2 * np.pi * excess * share, rel=1e-8)
    if found.sign > 0:
        assert (
            len(copies(found, lambda motions: np.ones(len(motions), bool), 200)) == SPHERES[orders]
        )


def test_cones_that_are_nearly_vertices_are_vertices() -> None:
    found = world(swirled_tile("IH2", 0, 3.1415926e-07), (2,))
    assert area(found) == pytest.approx(np.pi, rel=1e-8)


@given(st.floats(0, 1), st.floats(0.1, 0.9))
def test_of_vertices_near_a_cone_one_goes_there(along: float, apart: float) -> None:
    """Two that went there would be one, and a mesh would halve the side between them without end."""
    near = 0.2
    side = np.array([[0.0, 0.0], [1.0, 0.0], [1.0 + apart * near, 0.0], [3.0, 0.0]])
    ring = np.concatenate([side, [[3.0, 2.0], [0.0, 2.0]]])
    cone = np.array([[1.0 + along * apart * near, 0.0]])
    found = with_points(ring, cone, near)
    assert len(np.unique(found, axis=0)) == len(found) == len(ring)
    assert (found == cone[0]).all(axis=1).sum() == 1
    assert shapely.Polygon(found).area == pytest.approx(6.0)
    triangulate(found, near)


@settings(max_examples=2)
@given(tiles, st.sampled_from([(2, 3, 3), (2, 3, 4), (2, 3, 5), (3, 3, 4), (2, 3, 7)]))
def test_neighbours_have_other_colours(tile: Any, orders: Any) -> None:
    check_colours(world(tile, orders))


@settings(max_examples=2)
@given(sound(["IH1", "IH4", "IH5", "IH2"]))
def test_neighbours_have_other_colours_without_rotations_by_less(tile: Any) -> None:
    check_colours(world(tile, ORDERS[tile.isohedral_class][0]))


def check_colours(found: Unfolding) -> None:
    motions = copies(found, lambda own: (own @ found.middle)[:, 2] < 15, 150)
    numbers, count = colours(found, motions)
    assert set(numbers.tolist()) <= set(range(count))
    middles = motions @ found.middle
    near, tree = (
        np.einsum("mij,ejk,k->mei", motions, found.neighbours, found.middle),
        KDTree(middles),
    )
    far, index = map(np.asarray, tree.query(near))
    beside = far < 1e-6 * np.linalg.norm(near, axis=-1)
    assert beside.any()
    own = np.broadcast_to(numbers[:, None], index.shape)
    assert (numbers[index[beside]] != own[beside]).all()


@settings(max_examples=2)
@given(tiles, st.sampled_from([(2, 3, 3), (2, 3, 4), (2, 3, 5)]), st.integers(0, 99))
def test_copies_cover_the_sphere_once(tile: Any, orders: Any, seed: int) -> None:
    found = world(tile, orders)
    motions = copies(found, lambda own: np.ones(len(own), bool), 200)
    ways = np.random.default_rng(seed).normal(size=(300, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    polygon, place = seen_from_middle(found)
    count, doubtful = np.zeros(len(ways), int), np.zeros(len(ways), bool)
    for motion in motions:
        local = place(ways @ motion)  # the inverse of a rotation is its transpose
        count += shapely.contains_xy(polygon, local.real, local.imag)
        at = shapely.points(local.real, local.imag)
        doubtful |= shapely.distance(at, polygon.exterior) < 1e-3 * (1 + np.abs(local))
    assert (~doubtful).mean() > 0.7
    assert (count[~doubtful] == 1).all()


def seen_from_middle(found: Unfolding) -> tuple[shapely.Polygon, Any]:
    """The tile in a stereographic picture about its middle, and what takes directions there."""
    turn = facing(found.middle)

    def place(vectors: Array) -> Any:
        return disc_of(vectors @ turn.T)

    ring = np.concatenate(
        [
            (1 - t) * found.ring + t * np.roll(found.ring, -1, axis=0)
            for t in np.linspace(0, 1, 6, endpoint=False)
        ]
    ).reshape(6, -1, 2)
    seen = place(found.vectors(ring.swapaxes(0, 1).reshape(-1, 2)))
    return shapely.Polygon(np.column_stack([seen.real, seen.imag])), place


def escher(name: str) -> EscherTile:
    return EscherTile(swirled_tile(name, 3, 0.1))


SEEN = [
    ("sphere", "IH28", False), ("disc", "IH3", True), ("half-plane", "IH28", False),
    ("band", "IH5", False), ("spiral", "IH28", False), ("cylinder", "IH4", True),
]  # fmt: skip
"""Models, classes, and whether y points down: each of these somewhere."""


@pytest.mark.parametrize(("model", "name", "y_down"), SEEN)
def test_pages_are_full_and_not_mirrored(model: Any, name: str, y_down: bool) -> None:
    seeds = (swirled_tile(name, seed, 0.2) for seed in range(3, 99))
    given_tile = EscherTile(next(own for own in seeds if is_sound(own)), y_down=y_down)
    chosen = ArtSettings(world=model, area=(40.0, 40.0), dpi=100)
    found, notes = world_of(given_tile, chosen)
    assert notes
    ring = orient(given_tile.tile.polygon, counter_clockwise=True)
    first = found.places(found.vectors(ring), np.arange(1))[0]
    assert (signed_area(first) > 0) == y_down  # as on a page of the plane, whose y points down
    scene = world_scene(found, palette("lagoon")._replace(paper="#ff00ff"))
    shown: list[Any] = [
        own for layer in scene.layers for own in layer.items if layer.name.startswith("colour")
    ]
    rings = [shapely.make_valid(shapely.Polygon(own.flattened(0.01))) for own in shown]
    covered = shapely.union_all(rings, grid_size=1e-4)
    middle = shapely.Point(20, 20)
    seen = (
        middle.buffer(17).difference(middle.buffer(4)) if model == "spiral" else middle.buffer(10)
    )
    assert seen.difference(covered).area < 0.003 * seen.area
    within = sum(shapely.area(shapely.intersection(own, seen)) for own in rings)
    assert within == pytest.approx(seen.area, rel=0.01)


def test_curves_keep_their_tolerance() -> None:
    found, _ = world_of(escher("IH21"), ArtSettings(world="disc", area=(150.0, 150.0)))
    polygon = found.tiling.prototiles[0].polygon
    fine = np.concatenate([polygon, (polygon + np.roll(polygon, -1, axis=0)) / 2])
    vectors = found.vectors(fine)
    for k, curve in list(found.outlines(0))[:40]:
        true = found.places(vectors, np.array([k]))[0]
        line = shapely.LinearRing(curve.flattened(TOLERANCE / 10))
        assert shapely.distance(shapely.points(true), line).max() < 3 * TOLERANCE


def test_artwork_of_another_world_is_written(tmp_path: Path) -> None:
    page: Any = {"area": (30.0, 30.0)}
    done = art(escher("IH7"), tmp_path / "a.svg", ArtSettings(format="svg", world="disc", **page))
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")
    assert done.summary["tiles"] > 20
    sphere = ArtSettings(world="sphere", order=(2, 3, 5), dpi=50, **page)
    art(escher("IH7"), tmp_path / "b.png", sphere)
    art(escher("IH7"), tmp_path / "c.pdf", ArtSettings(world="cylinder", area=(60.0, 30.0)))
    assert (tmp_path / "c.pdf").read_bytes().startswith(b"%PDF")
    picture = np.asarray(Image.open(tmp_path / "b.png").convert("RGB")).astype(int)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3


@pytest.mark.parametrize(
    ("name", "given_settings", "what"),
    [
        ("IH4", {"world": "sphere"}, "p3, p4 and p6"),
        ("IH2", {"world": "sphere"}, "p3, p4 and p6"),
        ("IH4", {"world": "disc", "order": (2, 3, 7)}, "2,2,2,3"),
        ("IH1", {"world": "disc", "order": (2, 2, 2, 3)}, "1 order"),
        ("IH4", {"world": "disc", "order": (2, 2, 2, 2)}, "2, 2, 2, 2"),
        ("IH7", {"world": "sphere", "order": (2, 3, 7)}, "2, 3, 7"),
        ("IH7", {"world": "disc", "order": (2, 3, 5)}, "2, 3, 5"),
        ("IH7", {"world": "disc", "order": (3, 3, 3)}, "3, 3, 3"),
    ],
)
def test_what_has_no_such_world_says_why(
    name: str, given_settings: Any, what: str, tmp_path: Path
) -> None:
    with refused(what):
        art(escher(name), tmp_path / "a.png", ArtSettings(**given_settings))


@settings(max_examples=2)
@given(sound(ORDERS), st.sampled_from([None, (2, 1), (-1, 3), (4, 0)]))
def test_a_cylinder_meets_itself(tile: Any, arms: Any) -> None:
    chosen = ArtSettings(world="cylinder", area=(200.0, 80.0), arms=arms)
    found, _ = world_of(EscherTile(tile), chosen)
    rings = found.places(found.vectors(tile.polygon), np.arange(len(found.motions)))
    seen = shapely.box(0, 0, 200, 80)
    shapes = [shapely.Polygon(ring).buffer(0) for ring in rings]
    assert seen.difference(shapely.union_all(shapes, grid_size=1e-6)).area < 1e-3
    middles = np.array([ring.mean(axis=0) for ring in rings])
    for k in np.flatnonzero(rings[:, :, 0].min(axis=1) < 0):  # across the left edge
        away = np.linalg.norm(middles - middles[k] - (200, 0), axis=1)
        assert away.min() < 1e-6
        assert found.colours[away.argmin()] == found.colours[k]
    for j, k in itertools.combinations(range(len(shapes)), 2):
        if found.colours[j] == found.colours[k]:
            shared = shapes[j].buffer(0.01).intersection(shapes[k])
            assert shared.area < 0.01 * 0.2 * np.sqrt(shapes[j].area)


def test_each_of_two_figures_has_its_own_colours(tmp_path: Path) -> None:
    pair = pair_result().tiles[0]
    art(pair, tmp_path / "pair.svg", ArtSettings(format="svg", world="spiral", palette="lagoon"))
    found, _ = world_of(pair, ArtSettings(world="spiral"))
    numbers = [{found.colour(k, kind) for k in range(len(found.motions))} for kind in (0, 1)]
    assert not numbers[0] & numbers[1]
    for kind, one in enumerate(found.tiling.prototiles):  # copies that touch differ
        rings = found.places(found.vectors(one.polygon), np.arange(len(found.motions)))
        wide = [shapely.Polygon(ring).buffer(0.05) for ring in rings]
        for j, k in itertools.combinations(range(len(wide)), 2):
            if found.colour(j, kind) == found.colour(k, kind):
                assert wide[j].intersection(wide[k]).length < 0.5
    text = (tmp_path / "pair.svg").read_text()
    fills = set(re.findall(r'fill="(#[0-9a-f]{6})"', text))
    shaded = palette("lagoon").shaded((found.count,) * 2)
    assert {shaded.fill(k) for k in range(2 * found.count)} <= fills


@pytest.mark.parametrize("model", ["sphere", "disc", "spiral"])
def test_pages_are_turned(model: Any) -> None:
    tile = escher("IH28")
    page: Any = {"world": model, "area": (60.0, 60.0)}
    straight, turned = (world_of(tile, ArtSettings(**page, rotate=a))[0] for a in (0.0, 90.0))
    vectors, first = straight.vectors(tile.tile.polygon), np.arange(1)
    x, y = (straight.places(vectors, first)[0] - 30).T
    assert np.abs(turned.places(vectors, first)[0] - 30 - np.column_stack([y, -x])).max() < 1e-9


def test_settings_of_worlds_are_checked() -> None:
    every: Any = ({"order": (1, 3, 5)}, {"tile_size": 20.0}, {"clip": False}, {"colour": "aspect"})
    with refused("band", "area"):
        ArtSettings(world="band", area=(400.0, 30.0))
    for wrong in every:
        with pytest.raises(OrbiflowError):
            ArtSettings(world="disc", **wrong)
    with pytest.raises(OrbiflowError):
        ArtSettings(world="spiral", arms=(0, 0))
