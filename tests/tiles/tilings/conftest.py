"""Tiles to test with: templates, stretched and perturbed, of every class."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import pytest

from orbiflow.arrays import Array
from orbiflow.symmetry import CrystallographicGroup, Isometry
from orbiflow.tiles import CLASSES, IsohedralClass, Tile

MakeTile: TypeAlias = Callable[..., Tile]


def subdivide(vertices: Array, per_edge: int) -> Array:
    """`per_edge` points on each edge at uniform parameters, corners included."""
    share = np.linspace(0.0, 1.0, per_edge, endpoint=False)[:, None]
    edges = zip(vertices, np.roll(vertices, -1, axis=0), strict=True)
    return np.concatenate([start + share * (end - start) for start, end in edges])


def random_field(group: CrystallographicGroup, seed: int) -> Callable[[Array], Array]:
    """A periodic trigonometric vector field, about one in size."""
    rng = np.random.default_rng(seed)
    frequencies, phases = rng.integers(-2, 3, (6, 2)), rng.uniform(0, 2 * np.pi, 6)
    amplitudes = rng.normal(size=(6, 2)) / 3

    def field(points: Array) -> Array:
        angles = 2 * np.pi * points @ group.inverse_lattice.T @ frequencies.T + phases
        return np.cos(angles) @ amplitudes

    return field


def mean_over_cosets(
    field: Callable[[Array], Array], group: CrystallographicGroup
) -> Callable[[Array], Array]:
    def pulled_back(g: Isometry, points: Array) -> Array:
        return field(g(points)) @ g.linear  # R^-1 V on rows

    return lambda points: np.mean([pulled_back(g, points) for g in group.cosets], axis=0)


def make_tile(
    kind: IsohedralClass,
    seed: int = 0,
    *,
    bend: float = 0.08,
    stretch: float = 0.0,
    shape: float = 0.0,
    per_edge: int = 40,
) -> Tile:
    """Template with random shape, deformed by an equivariant Euler step, then stretched."""
    rng = np.random.default_rng(seed)
    vertices = kind.template(rng.uniform(-shape, shape, kind.shape_dim))
    field = mean_over_cosets(random_field(kind.group(), seed), kind.group())
    polygon = subdivide(vertices, per_edge)
    linear = kind.stretch(rng.uniform(-stretch, stretch, kind.stretch_dim))
    polygon = (polygon + bend * field(polygon)) @ linear.T
    return Tile(
        polygon, kind.group().conjugate(linear), kind.name, tuple(range(0, len(polygon), per_edge))
    )


@pytest.fixture(params=CLASSES, name="kind")
def kind_fixture(request: pytest.FixtureRequest) -> IsohedralClass:
    """Each of the nine classes in turn."""
    return CLASSES[request.param]


@pytest.fixture(name="make_tile")
def make_tile_fixture() -> MakeTile:
    return make_tile


@pytest.fixture(name="random_field")
def random_field_fixture() -> Callable[[CrystallographicGroup, int], Callable[[Array], Array]]:
    return random_field


@pytest.fixture(name="subdivide")
def subdivide_fixture() -> Callable[[Array, int], Array]:
    return subdivide
