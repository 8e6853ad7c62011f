"""Dots over a density: seen, and small where they crowd, so that its peaks are seen, too."""

import base64
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import orbiflow.density as od
from density.blends import bump
from orbiflow.density.pictures.grounds import MAX_COVER, uncrowded
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.projections import chosen_map
from orbiflow.drawing import Picture, Sheet


@given(st.integers(0, 2**31), st.integers(2, 60), st.floats(0.01, 100), st.integers(2, 3))
def test_widths_are_in_the_points_unit_and_repeated_points_are_one(seed, count, scale, dim) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, dim))
    places, widths = uncrowded(points)
    assert np.array_equal(places, points)
    np.testing.assert_allclose(uncrowded(scale * points)[1], scale * widths, rtol=1e-6)
    again, same = uncrowded(np.concatenate([points, points[rng.integers(0, count, 30)]]))
    assert np.array_equal(again, places)
    assert np.array_equal(same, widths)


@pytest.mark.parametrize("count", [200, 20_000])
def test_dots_hide_no_more_than_their_share(count: int) -> None:
    points = np.random.default_rng(1).uniform(0, 1, (count, 2))
    widths = uncrowded(points)[1]
    assert np.pi / 4 * float((widths**2).sum()) == pytest.approx(MAX_COVER, rel=0.35)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_dots(count: int) -> None:
    places, widths = uncrowded(np.arange(2.0 * count).reshape(count, 2))
    assert len(places) == len(widths) == count
    assert (widths > 0).all()


def peaked(name: str) -> od.Mixture:
    """One narrow peak on an even floor."""
    space = od.make_space(name)
    return od.Mixture([bump(space, 60.0, (0.4, 0.3)), od.UniformDensity(space)], [0.9, 0.1])


def pixels(picture: Picture) -> np.ndarray:
    """Of the axes (rows, columns, 3), without the colour bar."""
    found = np.asarray(Image.open(io.BytesIO(picture.file())).convert("RGB"), dtype=np.float64)
    rows, columns = found.shape[:2]
    box = max(
        (axes.get_position() for axes in picture.figure.axes), key=lambda b: b.width * b.height
    )
    return found[
        round(rows * (1 - box.y1)) : round(rows * (1 - box.y0)),
        round(columns * box.x0) : round(columns * box.x1),
    ]


@pytest.mark.parametrize(("name", "count"), [("klein-bottle", 100), ("sphere", 2000)])
def test_a_peak_is_seen_through_its_dots(name: str, count: int, monkeypatch) -> None:
    monkeypatch.setattr("orbiflow.density.pictures.square._FINE_GRID", 120)
    monkeypatch.setattr("orbiflow.density.pictures.maps._PIXELS", 20_000)
    density = peaked(name)
    drawn = density.sample((count,), torch.Generator().manual_seed(0))
    sheet = replace(Sheet.column("single", "png"), dpi=300)
    settings = od.PlotSettings(samples=count, scale="linear")

    def picture(dots: torch.Tensor | None) -> np.ndarray:
        if density.space.is_round:
            drawn_map = Map(density.space, chosen_map(density.space, drawn))
            made = od.density_picture(density, dots, settings, sheet=sheet, ground=drawn_map)
        else:
            made = od.density_picture(density, dots, settings, sheet=sheet)
        return pixels(made)

    bare, dotted = picture(None), picture(drawn)
    yellow = (bare[..., 0] > 180) & (bare[..., 1] > 200) & (bare[..., 2] < 120)
    assert yellow.sum() > 100
    off = np.abs(bare - dotted).max(axis=-1)
    assert off[yellow].mean() < 70
    assert (off[yellow] > 60).mean() < 0.45
    assert (off > 100).sum() > 5 * min(count, 300)  # dots are seen all the same


@pytest.mark.parametrize("name", ["torus", "sphere"])
def test_the_page_has_the_dots_widths(name: str) -> None:
    density = peaked(name)
    drawn = density.sample((200,), torch.Generator().manual_seed(0))
    page = od.density_page(density, resolution=8, samples=torch.cat([drawn, drawn[:50]]))
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    data = json.loads(found[1])
    places, widths = (
        np.frombuffer(base64.b64decode(data[key]), "<f4") for key in ("samples", "widths")
    )
    assert places.shape == (600,)
    assert widths.shape == (200,)
    crowded = np.argsort(
        ((places.reshape(-1, 3) - np.median(places.reshape(-1, 3), 0)) ** 2).sum(1)
    )
    assert np.median(widths[crowded[:50]]) < np.median(widths[crowded[-20:]]) / 2
    assert "Dots are smaller where they crowd." in page
    assert "crowd" not in od.density_page(density, resolution=8)
