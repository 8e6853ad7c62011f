"""Maps of triangulations freed of folds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.tiles import signed_area
from orbiflow.tiles.silhouette import Mesh, triangulate, unfolded
from orbiflow.tiles.silhouette.bending import _Distortion
from outlines import ANIMALS, SHAPES, animal, disc
from refusals import refused
from strategies import seeds

MESHES: dict[str, Mesh] = {
    name: triangulate(ring)
    for name, ring in {
        "disc": disc(48),
        "star": SHAPES["star"],
        "comb": SHAPES["comb"],
        **{name: np.asarray(animal(name).normal) for name in ANIMALS[:2]},
    }.items()
}


def outline(mesh: Mesh) -> int:
    return mesh.size + len(mesh.sides)


def shuffled(mesh: Mesh, seed: int, share: float) -> Array:
    """Points inside put elsewhere inside the bounding box, the outline left."""
    rng = np.random.default_rng(seed)
    images = mesh.points.copy()
    inner = len(images) - outline(mesh)
    low, high = images.min(axis=0), images.max(axis=0)
    moved = rng.random(inner) < share
    images[outline(mesh) :][moved] = rng.uniform(low, high, (inner, 2))[moved]
    return images


@pytest.mark.parametrize("name", MESHES)
@settings(max_examples=4)
@given(seed=seeds, share=st.floats(0.05, 1.0))
def test_any_placing_of_the_inner_points_is_untangled(name: str, seed: int, share: float) -> None:
    mesh = MESHES[name]
    images = shuffled(mesh, seed, share)
    found = unfolded(mesh, images)
    assert (signed_area(found[mesh.triangles]) > 0).all()
    assert (signed_area(found[mesh.triangles]) > 0).all()
    assert np.array_equal(found[: outline(mesh)], images[: outline(mesh)])
    assert (
        abs(signed_area(found[mesh.triangles]).sum() - signed_area(mesh.points[: mesh.size])) < 1e-9
    )


@pytest.mark.parametrize("name", MESHES)
def test_nothing_moves_where_nothing_is_folded(name: str) -> None:
    mesh = MESHES[name]
    images = mesh.points @ [[1.0, 0.2], [0.5, 2.0]]
    assert unfolded(mesh, images) is images


@given(seeds)
def test_an_outline_that_moves(seed: int) -> None:
    """A disc's outline on a wavy one: the inside follows."""
    mesh = MESHES["disc"]
    rng = np.random.default_rng(seed)
    images = mesh.points.copy()
    turns = np.arctan2(*images[: outline(mesh)].T[::-1])
    a, b = rng.uniform(-0.25, 0.25, 2)
    images[: outline(mesh)] *= (1 + a * np.cos(3 * turns) + b * np.sin(2 * turns))[:, None]
    images[outline(mesh) :] += rng.normal(size=(len(images) - outline(mesh), 2)) * 0.1
    assert (signed_area(unfolded(mesh, images)[mesh.triangles]) > 0).all()


@given(seeds, st.floats(0.02, 1.0))
def test_gradient(seed: int, epsilon: float) -> None:
    mesh = MESHES["star"]
    work = _Distortion(mesh, shuffled(mesh, seed, 0.3))
    work.epsilon = epsilon
    rng = np.random.default_rng(seed)
    x = work.start + 0.01 * rng.normal(size=len(work.start))
    way = rng.normal(size=len(x))
    way /= np.linalg.norm(way)
    step = 1e-6 * epsilon
    slope = (work.value(x + step * way)[0] - work.value(x - step * way)[0]) / (2 * step)
    value, gradient = work.value(x)
    assert gradient @ way == pytest.approx(slope, rel=1e-4, abs=1e-5 * value)


def test_determinants_far_above_and_below_the_bound() -> None:
    mesh = MESHES["disc"]
    work = _Distortion(mesh, shuffled(mesh, 1, 1.0))
    work.epsilon = 1e-12
    value, gradient = work.value(work.start)
    assert np.isfinite(value)
    assert np.isfinite(gradient).all()


def test_an_outline_turned_over_is_refused() -> None:
    mesh = MESHES["disc"]
    with refused("silhouette"):
        unfolded(mesh, mesh.points * (1.0, -1.0))
