"""Densities on grids for pages, their axes and colour bars, and small pictures of them."""

import base64
import io

import numpy as np
import pytest
import torch
from PIL import Image

from density.blends import random_kernels
from known_densities import kernels_about
from orbiflow.density import KleinBottle, ProjectivePlane, Sphere, Torus, UniformDensity
from orbiflow.density.pictures import density_thumbnail, flat_data, flat_frame
from orbiflow.density.pictures.colours import (
    DARK_SHARE,
    Shade,
    bar_label,
    bar_ticks,
    dark_share,
    measure_label,
    minor_places,
    shading,
    short_number,
)
from orbiflow.density.pictures.frames import angle_axis, angle_text, view_of
from orbiflow.density.pictures.plots import SIZE
from refusals import refused

SPACES = [Torus(1), Torus(2, unit="degrees"), KleinBottle(), Sphere(), ProjectivePlane()]
every_space = pytest.mark.parametrize("space", SPACES, ids=lambda s: f"{s.name}-{s.dim}")


def floats(text):
    return np.frombuffer(base64.b64decode(text), "<f4").astype(float)


def grid(data):
    return np.exp(floats(data["logs"])).reshape(data["cells"])


def kernels(space, seed=0):
    return random_kernels(np.random.default_rng(seed), space, 4, 1.0, 15.0)


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


AXES_SPACES = [Torus(2, unit="degrees"), KleinBottle(), Sphere(), ProjectivePlane()]


@pytest.mark.parametrize(
    ("turns", "unit", "text"),
    [
        (0.5, "radians", "π"), (-0.25, "radians", "−π/2"), (0, "radians", "0"),
        (0.125, "degrees", "45°"), (0.25, "turns", "0.25"),
    ],
)  # fmt: skip
def test_angles_are_written_in_their_unit(turns, unit, text):
    assert angle_text(turns, unit) == text


def test_measures_are_named():
    assert measure_label(AXES_SPACES[0], "natural") == "density, per degree²"
    assert measure_label(AXES_SPACES[2], "natural") == "density, per steradian"
    assert "uniform" in measure_label(AXES_SPACES[2], "uniform")
    assert "square" in measure_label(AXES_SPACES[1], "square")


def test_a_few_far_values_do_not_darken_the_picture():
    values = np.full(10_000, 1.0)
    assert shading(values) == Shade(0.0, 1.0, 1.0)
    values[:5] = 50.0
    assert shading(values) == Shade(0.0, 1.0, 50.0, cut=True)
    assert shading(values, np.where(values > 1, 1000.0, 1.0)) == Shade(0.0, 50.0, 50.0)


def test_logarithms_span_five_decades_at_most_and_one_at_least():
    shade = shading(np.array([1e-30, 0.1, 4.0]), log=True)
    assert shade == Shade(4e-5, 4.0, 4.0, log=True, faint=True)
    np.testing.assert_allclose(shade.places(np.array([0.0, 4e-5, 4e-3, 4.0])), [0, 0, 0.4, 1])
    even = shading(np.array([1.0, 1.01]), log=True)
    assert even.low == pytest.approx(0.101)
    assert not even.faint
    several = shading(np.array([0.02, 4.0]), log=True)
    assert several.low == 0.02


def test_logarithms_are_taken_where_a_peak_outshines_the_area():
    values = np.full(1000, 0.04)
    values[:40] = 1.0
    assert dark_share(values) == 0.96 > DARK_SHARE
    assert dark_share(values, np.where(values == 1.0, 10.0, 1.0)) == pytest.approx(960 / 1360)
    assert dark_share(np.linspace(0, 1, 1000)) == 0.1


def test_colour_bars_are_in_short_numbers():
    degrees = AXES_SPACES[0]
    linear = shading(np.linspace(0, 4.3e-4, 50))
    assert bar_label(linear, degrees, "natural") == "density, 10⁻⁴ per degree²"
    assert [tick.text for tick in bar_ticks(linear)] == ["0", "1", "2", "3", "4"]
    assert bar_ticks(linear)[1].at == pytest.approx(1 / 4.3)
    cut = linear._replace(peak=5e-3, cut=True)
    assert bar_label(cut, degrees, "natural") == "density, 10⁻⁴ per degree² (peak 50)"
    assert bar_ticks(cut, ends=True)[-1] == (1.0, "≥ 4.3")
    log = shading(np.array([0.0, 4.3e-3]), log=True)
    assert bar_label(log, degrees, "natural") == "density, per degree²"
    texts = ["10⁻⁷", "10⁻⁶", "10⁻⁵", "10⁻⁴", "0.001"]
    assert [tick.text for tick in bar_ticks(log)] == texts
    assert bar_ticks(log, ends=True)[0] == (0.0, "≤ 4.3 × 10⁻⁸")
    assert all(0 <= place <= 1 for place in minor_places(log))
    assert len(minor_places(log)) > 35
    narrow = shading(np.array([0.03, 1.0]), log=True)
    assert [tick.text for tick in bar_ticks(narrow)] == ["0.05", "0.1", "0.2", "0.5", "1"]
    assert short_number(12_340.0, 2) == "1.2 × 10⁴"


def test_angles_of_a_torus_run_round_the_centre():
    space = AXES_SPACES[0]
    label, places, texts = angle_axis(view_of(space, ("phi", "psi")), 1)
    assert label == "ψ (degrees)"
    assert places == [0, 0.25, 0.5, 0.75, 1]
    assert texts == ["−180°", "−90°", "0°", "90°", "180°"]
    assert angle_axis(view_of(space, center=(180, 0)), 0)[2][-1] == "360°"
    _, places, texts = angle_axis(view_of(space, center=(30, 0)), 0)
    np.testing.assert_allclose(places, [1 / 6, 5 / 12, 2 / 3, 11 / 12])
    assert texts == ["−90°", "0°", "90°", "180°"]
    assert angle_axis(view_of(Torus(2), center=(3.14, 3.14)), 0)[2][-1] == "2π"


def test_points_lie_where_the_axes_say():
    space = AXES_SPACES[0]
    where = space.to_chart([[-63.0, -43.0], [170.0, 300.0]])
    np.testing.assert_allclose(
        view_of(space).places(where), (np.array([[-63, -43], [170, -60]]) + 180) / 360
    )
    around = view_of(space, center=(180, 180))
    np.testing.assert_allclose(around.places(where), np.array([[297, 317], [170, 300]]) / 360)
    back = around.to_chart(torch.tensor(around.places(where)))
    np.testing.assert_allclose(space.project(back), where, atol=1e-12)


def pixels(png: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(png)) as image:
        assert (image.format, image.size) == ("PNG", SIZE)
        return np.asarray(image.convert("RGB")).astype(int)


@pytest.mark.parametrize("space", [*SPACES, Torus(3), Torus(8)], ids=lambda s: f"{s.name}-{s.dim}")
def test_every_space_has_one_that_is_the_same_every_time(space) -> None:
    density = kernels(space)
    data = space.from_chart(density.sample((60,), torch.Generator().manual_seed(0)))
    png = density_thumbnail(density, data)
    assert png == density_thumbnail(density, data)
    assert len(png) < 80_000
    found = pixels(png)
    assert len(np.unique(found.reshape(-1, 3), axis=0)) > 20


def test_the_brightest_place_of_the_square_is_the_peak() -> None:
    density = kernels_about(Torus(2), [[1.2, -0.8]], [40.0], [1.0])
    found = pixels(density_thumbnail(density, np.array([[1.2, -0.8], [0.2, -0.8]])))
    # viridis ends in yellow; beside the square, from 60 to 300, there is paper
    yellow = (found[..., 0] + found[..., 1] - found[..., 2])[:, 60:300]
    row, column = np.unravel_index(yellow.argmax(), yellow.shape)
    assert (column + 0.5) / 240 == pytest.approx(0.5 + 1.2 / (2 * np.pi), abs=0.04)
    assert 1 - (row + 0.5) / 240 == pytest.approx(0.5 - 0.8 / (2 * np.pi), abs=0.04)


def test_rows_that_lack_angles_are_left_out() -> None:
    density, data = kernels(Torus(1)), np.array([[0.3], [0.9]])
    with_missing = np.concatenate([data, [[np.nan]]])
    assert density_thumbnail(density, data) == density_thumbnail(density, with_missing)
