"""Placements, nearest tiles and start tiles, and which starting poses really differ."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
import torch

from orbiflow.arrays import Array
from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    OverlapSearch,
    Target,
    TileModel,
    escherize_class,
    resampled,
)
from orbiflow.tiles.flowing.starts import (
    initial_poses,
    nearest_tiles,
    outline_starts,
    template_starts,
)
from orbiflow.tiles.search import Placements, Prototiles, best_placements, template_symmetries
from strategies import divided_start

BOOT = np.array([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]])
TARGET = Target.from_polygon(BOOT)
OUTLINE = resampled(TARGET.normal, 60) @ np.array([1, 1j])


@cache
def placements(name: str, keep: int) -> Placements:
    return best_placements(CLASSES[name], OUTLINE, keep)


def exact_tile(name: str, seed: int) -> tuple[Array, Placements]:
    """A bent tile of the class in a random pose, 60 or 40 vertices, and its placement."""
    kind = CLASSES[name]
    torch.manual_seed(seed)
    pieces = 10 if len(kind.template()) == 6 else 8
    model = TileModel(kind, torch.rand(1) * 6, max_frequency=2, smoothness=2.0)
    with torch.no_grad():
        field = model.fourier_fields()[0]
        field.parameters_.copy_(0.04 * torch.randn_like(field.parameters_))
        model.log_scale.add_(0.3)
        model.stretch.normal_(std=0.1)
        ring = model(divided_start(model, pieces))[0].numpy()
        turn = float(model.angle) if kind.stretch_dim == 1 else 0.0
    lengths = np.full((1, len(kind.template())), pieces)
    return ring, Placements(lengths, np.zeros(1, int), np.array([turn]))


@pytest.mark.parametrize("name", CLASSES)
def test_a_tile_is_found_as_one(name: str) -> None:
    ring, placement = exact_tile(name, 1)
    outline = ring @ np.array([1, 1j])
    found = best_placements(CLASSES[name], outline, 50)
    assert nearest_tiles(CLASSES[name], outline, found.take(np.array([0]))).distance[0] < 1e-12
    # and it is its own nearest tile
    own = nearest_tiles(CLASSES[name], outline, placement)
    assert own.distance[0] < 1e-12
    assert np.allclose(own.vertices[0], outline, atol=1e-7)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", CLASSES)
def test_prototiles_are_placed_where_the_tiles_are(name: str, mirrored: bool) -> None:
    kind = CLASSES[name]
    tiles = nearest_tiles(kind, OUTLINE, placements(name, 60).take(np.arange(40)))
    tiles = tiles.take(np.flatnonzero(np.linalg.det(tiles.linear) > 0)[:5])
    prototiles = Prototiles.of(kind, tiles, 60, mirrored=mirrored)
    model = TileModel(kind, max_frequency=1, prototiles=prototiles)
    with torch.no_grad():
        placed = model.place(model.prototile()[0]).numpy() @ np.array([1, 1j])
    assert np.allclose(np.conj(placed) if mirrored else placed, tiles.vertices, atol=1e-8)
    twice = Prototiles.joined([prototiles, prototiles.take([0])])
    assert len(twice) == len(prototiles) + 1
    assert np.array_equal(twice.vertices[-1], prototiles.vertices[0])


@pytest.mark.parametrize("name", CLASSES)
def test_template_starts_are_centred(name: str) -> None:
    kind = CLASSES[name]
    starts = template_starts(kind, turns=4, stretch=0.3, vertices=60)
    model = TileModel(kind, max_frequency=1, prototiles=starts)
    with torch.no_grad():
        placed = model.place(model.prototile()[0]).numpy()
    corners = np.take_along_axis(placed, starts.corners[:, :, None], axis=1)
    assert abs(corners.mean(axis=1)).max() < 1e-9
    assert np.allclose(shapely.area(shapely.polygons(placed)), 1.0)


@pytest.mark.parametrize("name", CLASSES)
def test_starts_are_simple_different_and_best_first(name: str) -> None:
    kind = CLASSES[name]
    few = OverlapSearch(candidates=8, resolutions=(30, 48), projected=100, measured=20)
    found = outline_starts(TARGET, kind, few)
    assert 1 <= len(found.prototiles) <= 8
    assert (np.diff(found.iou) <= 0).all()
    model = TileModel(kind, max_frequency=1, prototiles=found.prototiles)
    with torch.no_grad():
        placed = model.place(model.prototile()[0]).numpy()
    goal = shapely.Polygon(TARGET.normal)
    for ring, value in zip(placed, found.iou, strict=True):
        polygon = shapely.Polygon(ring)
        assert polygon.is_valid
        iou = polygon.intersection(goal).area / polygon.union(goal).area
        assert iou == pytest.approx(value, abs=1e-9)
    shifted = outline_starts(TARGET, kind, replace(few, seed=1))
    assert shifted.iou.shape != found.iou.shape or not np.allclose(shifted.iou, found.iou)


def test_thin_limbs_still_give_starts() -> None:
    angle = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    radius = 0.25 + np.cos(4 * angle) ** 16
    star = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    found = outline_starts(Target.from_polygon(star), CLASSES["IH4"], OverlapSearch(candidates=10))
    assert len(found.prototiles) == 10


def test_only_ih21_needs_mirror_images() -> None:
    assert [name for name, kind in CLASSES.items() if not template_symmetries(kind)[1]] == ["IH21"]
    image = Target.from_polygon(BOOT * (-1, 1))
    wide = OverlapSearch(candidates=40, resolutions=(60,))
    one, two = (outline_starts(t, CLASSES["IH21"], wide) for t in (TARGET, image))
    assert one.prototiles.mirrored.any()
    assert not one.prototiles.mirrored.all()
    assert one.iou[0] == pytest.approx(two.iou[0], abs=0.02)  # the points differ


FAST = OverlapSearch.for_effort("fast")


def test_a_square_stays_a_square() -> None:
    square = Target(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), y_down=False)
    result = escherize_class(square, "IH1", FAST)
    assert not isinstance(result, ClassFailure)
    assert result.certificate.valid
    assert result.likeness.metrics.iou > 0.9999


def test_templates_join_where_the_outline_gives_poor_starts() -> None:
    teeth = [
        point
        for k in range(20)
        for point in ((k, 1.0), (k + 0.2, 1.0), (k + 0.2, 12.0), (k + 0.6, 12.0), (k + 0.6, 1.0))
    ]
    comb = Target(np.array([(0.0, 0.0), *teeth[1:], (20.0, 1.0), (20.0, 0.0)][::-1]), y_down=False)
    result = escherize_class(comb, "IH1", FAST)
    assert not isinstance(result, ClassFailure)
    assert result.likeness.metrics.iou > 0.2


# class: order of the rotations, whether there is a reflection
SYMMETRIES = {
    **{"IH1": (6, True), "IH2": (2, True), "IH3": (2, True), "IH4": (2, True), "IH5": (1, True)},
    **{"IH6": (1, True), "IH7": (3, True), "IH21": (1, False), "IH28": (1, True)},
}


@pytest.mark.parametrize("name", CLASSES)
def test_symmetries(name: str) -> None:
    assert template_symmetries(CLASSES[name]) == SYMMETRIES[name]


@pytest.mark.parametrize("turns", [1, 5, 12])
@pytest.mark.parametrize("name", CLASSES)
def test_poses_divide_the_range(name: str, turns: int) -> None:
    order, mirror_closed = SYMMETRIES[name]
    angles, mirrored = initial_poses(CLASSES[name], turns)
    assert angles.shape == mirrored.shape == ((1 if mirror_closed else 2) * turns,)
    assert mirrored.dtype == bool
    assert mirrored.any().item() is not mirror_closed
    for flag in {False, not mirror_closed}:
        own = angles[mirrored == flag]
        gaps = np.diff(own, append=own[:1] + 2 * math.pi / order)
        np.testing.assert_allclose(gaps, 2 * math.pi / order / turns, atol=1e-12)
