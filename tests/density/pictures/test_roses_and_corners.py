"""Roses, whose areas are shares; corner plots with as many of each, whose ticks do not touch."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from matplotlib.axes import Axes
from matplotlib.projections.polar import PolarAxes

from known_densities import kernels_about
from orbiflow.density import PlotSettings, Torus, plot_density
from orbiflow.density.pictures import Rose, corner_picture, rose_picture, roses_picture, sectors_of
from orbiflow.density.pictures.frames import symbol
from orbiflow.drawing import Sheet

SHEETS = {"screen": Sheet.screen(600), "column": Sheet.column("double", "png")}


def torus(dim: int):
    return kernels_about(Torus(dim, unit="degrees"), [[60.0] * dim], [4.0], [1.0])


@pytest.mark.parametrize(
    ("dim", "middle", "name"), [(2, 100.0, "column"), (3, 0.0, "screen"), (5, 0.0, "column")]
)
def test_ticks_of_corner_plots_do_not_touch(dim: int, middle: float, name: str) -> None:
    density, few = torus(dim), torch.zeros(2, dim)
    settings = PlotSettings(names=("phi",) * dim, center=(middle,) * dim)
    figure = corner_picture(density, few, few, settings, sheet=SHEETS[name]).figure
    texts = [
        label
        for axes in figure.axes
        for label in (*axes.get_xticklabels(), *axes.get_yticklabels())
        if label.get_text()
    ]
    boxes = [label.get_window_extent() for label in texts]
    assert len(texts) >= 2 * dim - 1
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k]), texts[k].get_text()


@pytest.mark.parametrize(("data", "samples", "shown"), [(40, 90, 40), (90, 40, 40), (90, 90, 90)])
def test_corner_plots_draw_as_many_of_each(data: int, samples: int, shown: int) -> None:
    density = torus(2)
    drawn = [density.sample((count,)) for count in (data, samples)]
    figure = corner_picture(density, drawn[0], drawn[1], sheet=SHEETS["screen"]).figure
    dots = [len(np.asarray(c.get_offsets())) for axes in figure.axes for c in axes.collections]
    assert dots == [shown, shown]
    heads = " ".join(text.get_text() for text in figure.texts)
    assert f"{min(data, samples)} samples" in heads


def bars(axes: Axes) -> list[tuple[float, float]]:
    return [(bar.get_width(), bar.get_height()) for bar in axes.patches if bar.get_height() > 0]  # pyright: ignore[reportAttributeAccessIssue]


def test_areas_of_a_rose_are_shares() -> None:
    turns, weights = np.array([0.01, 0.26, 0.27, 0.9]), np.array([1.0, 1.0, 1.0, 3.0])
    roses = [
        Rose("phi", turns, weights),
        Rose("wind direction", turns, None, None, (0.25, 0.4, 0.1)),
    ]
    one, other = roses_picture(roses, "degrees", "Two", SHEETS["screen"]).figure.axes
    areas = sorted(width * height**2 / 2 for width, height in bars(one))
    assert np.divide(areas, areas[0]) == pytest.approx([1, 2, 3])
    assert isinstance(one, PolarAxes)
    assert isinstance(other, PolarAxes)
    assert (one.get_title(), other.get_title()) == ("φ", "wind direction")
    assert (one.get_theta_direction(), other.get_theta_direction()) == (1, -1)  # as on a compass
    mean = other.lines[0].get_xydata()
    assert np.asarray(mean)[:, 0] == pytest.approx(np.pi / 2)


def test_a_rose_has_the_curve_of_its_density(tmp_path: Path) -> None:
    density = torus(1)
    points = density.sample((4000,), torch.Generator().manual_seed(0))
    (axes,) = rose_picture(density, points, PlotSettings(names=("phi",))).figure.axes
    angles, radii = np.asarray(axes.lines[0].get_xydata()).T
    assert float((radii[1:] ** 2 * np.diff(angles)).sum()) / (2 * np.pi) == pytest.approx(
        1, abs=1e-3
    )
    assert np.degrees(angles[radii.argmax()]) == pytest.approx(60, abs=1)
    assert sum(w * h**2 for w, h in bars(axes)) / (2 * np.pi) == pytest.approx(1)
    assert axes.get_title() == "φ"
    settings = PlotSettings(format="svg", width=60)
    plotted = plot_density(density, tmp_path / "out", settings)
    assert {path.name for path in plotted.files} == {"samples.svg", "rose.svg"}


@pytest.mark.parametrize(
    ("name", "shown"),
    [("phi", "φ"), ("Psi", "ψ"), ("chi12", "χ₁₂"), ("omega_1", "ω₁"), ("phi angle", "phi angle"),
     ("x", "x"), ("", ""), ("12", "12"), ("phi\n", "φ")],
)  # fmt: skip
def test_greek(name: str, shown: str) -> None:
    assert symbol(name) == shown


@pytest.mark.parametrize("directions", [8, 16, 24, 36, 72, 360])
@pytest.mark.parametrize("rows", [40, 84, 300, 1000])
def test_sectors_of_rounded_angles_hold_as_many_directions_each(directions: int, rows: int) -> None:
    rng = np.random.default_rng(directions)
    turns = rng.integers(0, directions + 1, rows) / directions  # 0 and 1 are one direction
    count, first = sectors_of(turns, 18)
    if count > directions:
        return
    held = np.histogram((np.arange(directions) / directions - first) % 1, count, (0, 1))[0]
    assert len(set(held)) == 1
    assert (len({*np.round(turns % 1, 9)}) < directions) or directions % count == 0
    if directions // count % 2:  # the middle of a sector is a direction, north among them
        middles = (first + (np.arange(count) + 0.5) / count) * directions
        assert np.allclose(middles, np.round(middles))
        assert (
            np.isclose(middles % directions, 0).any()
            or np.isclose(middles % directions, directions).any()
        )


def test_sectors_of_other_angles_are_as_before() -> None:
    rng = np.random.default_rng(0)
    assert sectors_of(rng.uniform(0, 1, 50), 18) == (18, 0.0)
    assert sectors_of(np.zeros(20), 12) == (12, 0.0)


def test_a_rose_of_whole_tens_is_centred_on_north() -> None:
    turns = (
        np.array([*[0] * 12, *[10] * 22, *[20] * 9, *[340] * 14, *[350] * 15, *[360] * 12]) / 360
    )
    roses = [Rose("wind", turns)]
    (axes,) = roses_picture(roses, "degrees", "One", SHEETS["screen"]).figure.axes
    bars: list[Any] = list(axes.patches)
    heights = {
        round(np.degrees(bar.get_x() + bar.get_width() / 2) % 360): bar.get_height() for bar in bars
    }
    shares = {angle: height**2 for angle, height in heights.items() if height > 0}
    assert shares[0] / sum(shares.values()) == pytest.approx((12 + 22 + 15 + 12) / 84)
    assert set(shares) == {0, 30, 330}
