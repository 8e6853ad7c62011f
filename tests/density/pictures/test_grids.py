"""Densities on grids for pages: masses, places, axes, and colours that suit the values."""

import base64

import numpy as np
import pytest
import torch

from density.blends import random_kernels
from known_densities import kernels_about
from orbiflow.density import KleinBottle, ProjectivePlane, Sphere, Torus, UniformDensity
from orbiflow.density.pictures import flat_data, flat_frame
from refusals import refused

SPACES = [Torus(1), Torus(2, unit="degrees"), KleinBottle(), Sphere(), ProjectivePlane()]
every_space = pytest.mark.parametrize("space", SPACES, ids=lambda s: f"{s.name}-{s.dim}")


def floats(text):
    return np.frombuffer(base64.b64decode(text), "<f4").astype(float)


def grid(data):
    return np.exp(floats(data["logs"])).reshape(data["cells"])


def kernels(space, seed=0):
    rng = np.random.default_rng(seed)
    if not space.is_round:
        return random_kernels(rng, space)
    centers = np.column_stack([rng.uniform(-80, 80, 4), rng.uniform(-180, 180, 4)])
    return kernels_about(
        space, centers, rng.uniform(3, 30, 4).tolist(), rng.uniform(1, 2, 4).tolist()
    )


@every_space
def test_a_grid_holds_the_whole_density(space):
    data = flat_data(kernels(space))
    values = grid(data)
    areas = np.ones_like(values)
    if space.is_round:
        lat = np.pi * ((np.arange(len(values)) + 0.5) / len(values) - 0.5)
        areas = np.repeat(np.cos(lat)[:, None], values.shape[1], axis=1)
    assert np.average(values, weights=areas) * space.volume == pytest.approx(1, abs=0.02)
    assert data["shade"]["high"] <= values.max() * 1.0001
    assert len(data["ticks"]) > 1


@every_space
def test_points_lie_where_their_density_is_drawn(space):
    # the density at a row, read off the grid at its place in the frame
    density = kernels(space)
    points = density.sample((40,), torch.Generator().manual_seed(1))
    frame = flat_frame(density, tuple(space.columns), points)
    places, values = (
        floats(frame["points"]).reshape(-1, 2 if space.is_round else space.dim),
        grid(flat_data(density)),
    )
    if space.is_round:
        places = places / (180, 360) + 0.5
    at = tuple(np.minimum((places * values.shape).astype(int), np.array(values.shape) - 1).T)
    exact = density.log_prob(points, measure="natural").exp().numpy()
    assert np.median(abs(values[at] / exact - 1)) < 0.1
    assert len(frame["axes"]) == (0 if space.is_round else space.dim)
    assert frame["shown"] == 40


def test_two_angles_of_three_are_drawn_whatever_the_third_is():
    space = Torus(3, unit="radians")
    density = kernels(space, 4)
    both, turned = (grid(flat_data(density, axes)) for axes in ((0, 2), (2, 0)))
    np.testing.assert_allclose(both, turned.T, rtol=1e-5)
    assert both.mean() * (2 * np.pi) ** 2 == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("axes", [(0,), (1, 1), (0, 3), (0, 1, 2), (-1, 0)])
def test_other_numbers_of_angles_are_refused(axes):
    with refused("different", "angles"):
        flat_data(UniformDensity(Torus(3)), axes)
