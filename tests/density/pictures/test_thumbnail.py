"""Small pictures of densities for pages of many."""

import io

import numpy as np
import pytest
from PIL import Image

from orbiflow.density import DensityEstimator
from orbiflow.density.pictures import density_thumbnail
from orbiflow.density.pictures.plots import SIZE

SPACES = {
    "one angle": ("torus", 1), "two": ("torus", 2), "three": ("torus", 3), "eight": ("torus", 8),
    "sphere": ("sphere", 2), "axes": ("projective-plane", 2), "bottle": ("klein-bottle", 2),
}  # fmt: skip


def data_of(count: int) -> np.ndarray:
    return np.random.default_rng(0).vonmises(0.5, 8.0, (60, count))


def pixels(png: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(png)) as image:
        assert (image.format, image.size) == ("PNG", SIZE)
        return np.asarray(image.convert("RGB")).astype(int)


@pytest.mark.parametrize("name", SPACES)
def test_every_space_has_one_that_is_the_same_every_time(name: str) -> None:
    space, count = SPACES[name]
    data = data_of(count)
    unit = "degrees" if space in ("sphere", "projective-plane") else None
    density = DensityEstimator(space, unit=unit, components="kernels").fit(data).density_
    png = density_thumbnail(density, data)
    assert png == density_thumbnail(density, data)
    assert len(png) < 80_000
    found = pixels(png)
    assert len(np.unique(found.reshape(-1, 3), axis=0)) > 20


def test_the_brightest_place_of_the_square_is_the_peak() -> None:
    data = np.degrees(np.random.default_rng(0).vonmises([1.2, -0.8], 40.0, (80, 2)))
    density = DensityEstimator(unit="degrees", components="kernels").fit(data).density_
    found = pixels(density_thumbnail(density, data))
    # viridis ends in yellow; beside the square, from 60 to 300, there is paper
    yellow = (found[..., 0] + found[..., 1] - found[..., 2])[:, 60:300]
    row, column = np.unravel_index(yellow.argmax(), yellow.shape)
    assert (column + 0.5) / 240 == pytest.approx(0.5 + 1.2 / (2 * np.pi), abs=0.04)
    assert 1 - (row + 0.5) / 240 == pytest.approx(0.5 - 0.8 / (2 * np.pi), abs=0.04)


def test_rows_that_lack_angles_are_left_out() -> None:
    data = data_of(1)
    density = DensityEstimator(components="kernels").fit(data).density_
    with_missing = np.concatenate([data, [[np.nan]]])
    assert density_thumbnail(density, data) == density_thumbnail(density, with_missing)
