"""Angles, longitudes and hours come back as they were written: from 0, or from minus half a turn."""

import json
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import shape as geometry

from orbiflow.arrays import Array
from orbiflow.density import summarize_angles, summarize_axes, summarize_directions
from orbiflow.density.models import AdaptiveKernels
from orbiflow.density.pictures.frames import angle_axis, view_of
from orbiflow.density.regions import DensityLevels, outlines, to_geojson
from orbiflow.density.spaces import (
    DataColumns,
    ProjectivePlane,
    RoundSpace,
    Space,
    Sphere,
    Torus,
    make_space,
)

SHIFTS = st.tuples(st.floats(0, 360), st.booleans(), st.integers(0, 2**31))


def column(shift: float, from_zero: bool, seed: int, period: float = 360.0) -> Array:
    """Return values (201,) about a shift in degrees, written from 0 or from minus half a turn."""
    turns = np.random.default_rng(seed).normal(shift, 60, 200) / 360
    first = 0.0 if from_zero else -0.5
    values = (turns - np.floor(turns - first)) * period
    # a column that does not tell where it is written from is left as it is
    return np.append(values, [0.75 * period] if from_zero else [-0.25 * period])


def space_of(name: str, values: Array, **how: Any) -> Space:
    known = DataColumns(name, **how)
    return known.of(known.read(values))


@given(SHIFTS)
@settings(max_examples=6, deadline=None)
def test_values_come_back_as_they_were(shift: tuple[float, bool, int]) -> None:
    angles, latitudes = column(*shift), np.linspace(1, 80, 201)
    hours = column(*shift, period=24.0)
    for values, space in (
        (rows := np.stack([angles], 1), space_of("torus", rows, unit="degrees")),
        (rows := np.stack([latitudes, angles], 1), space_of("sphere", rows)),
        (rows := np.stack([latitudes, angles], 1), space_of("projective-plane", rows)),
        (rows := np.stack([hours], 1), space_of("torus", rows, columns={0: "cycle:24"})),
        (
            rows := np.stack([latitudes, angles, latitudes, hours], 1),
            space_of("sphere", rows, columns={2: "linear", 3: "cycle:24"}),
        ),
    ):
        again = make_space(space.name, **json.loads(json.dumps(space.settings())))
        for one in (space, again):
            np.testing.assert_allclose(one.from_chart(one.to_chart(values)), values, atol=1e-6)


@given(SHIFTS)
@settings(max_examples=12, deadline=None)
def test_means_lie_in_the_turn_of_the_data(shift: tuple[float, bool, int]) -> None:
    angles, first = column(*shift), 0.0 if shift[1] else -180.0
    rows = np.stack([np.full(len(angles), 20.0), angles], axis=1)
    (one,), _ = summarize_angles(angles, unit="degrees")
    means = [one.mean, (summarize_directions(rows).mean or (0, 0))[1]]
    axes = summarize_axes(rows)
    for mean in (*means, axes.principal[1], axes.pole[1]):
        assert mean is not None
        assert first <= mean < first + 360
    about = np.degrees(np.angle(np.exp(1j * np.radians(angles)).mean()))
    apart = (np.array([value - about for value in means if value is not None]) + 180) % 360 - 180
    assert apart == pytest.approx(0, abs=1e-6)


@given(st.lists(st.booleans(), min_size=2, max_size=2))
def test_axes_of_pictures_begin_where_the_data_do(written: list[bool]) -> None:
    for unit, zero, half in (("degrees", "0°", "−180°"), ("turns", "0", "−0.5")):
        kept = [k for k, from_zero in enumerate(written) if from_zero]
        view = view_of(Torus(2, unit=unit, from_zero=kept))
        for axis, from_zero in enumerate(written):
            _, places, texts = angle_axis(view, axis)
            assert (places[0], texts[0]) == (0.0, zero if from_zero else half)
    hours = view_of(space_of("torus", np.array([[-5.0, 1], [4, 2], [2, 3]]), **HOURS))
    assert angle_axis(hours, 0)[2] == ["−12", "−6", "0", "6", "12"]


HOURS: dict[str, Any] = {"columns": {0: "cycle:24", 1: "linear"}}


@pytest.mark.parametrize(
    ("kind", "lat", "lon"),
    [(Sphere, 10, 330), (Sphere, 85, 100), (ProjectivePlane, 3, 271), (ProjectivePlane, 50, 150)],
)
def test_regions_are_written_as_the_data_and_geojson_as_its_standard_says(
    kind: type[RoundSpace], lat: float, lon: float
) -> None:
    found: list[list[Any]] = []
    for from_zero in (False, True):
        space = kind(from_zero=from_zero)
        centers = space.to_chart([[lat, lon], [lat, (lon + 40) % 360]])
        kappa, weights = torch.tensor([[20.0], [30.0]]), torch.tensor([0.5, 0.5])
        density = AdaptiveKernels(space, centers, kappa.double(), weights.double())
        levels = DensityLevels(density, samples=2000)
        (one,) = outlines(levels, [levels.highest(0.9)], budget=30_000)
        low, _, high, _ = one.shape.bounds
        first = 0 if from_zero else -180
        assert first <= low < high <= first + 360
        assert one.polygons_mass == pytest.approx(0.9, abs=0.02)
        found.append([one, geometry(to_geojson([one])["features"][0]["geometry"])])
    (_, known), (one, shape) = found
    assert shape.is_valid
    assert -180 <= shape.bounds[0] < shape.bounds[2] <= 180
    assert len(shape.geoms) == len(known.geoms)
    assert shape.area == pytest.approx(one.shape.area, rel=1e-4)
    assert shape.symmetric_difference(known).area < 0.02 * known.area
