"""Colour bars, angles and windows of density pictures."""

import numpy as np
import pytest
import torch

from orbiflow.density import KleinBottle, ProjectivePlane, Sphere, Torus
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

SPACES = [Torus(2, unit="degrees"), KleinBottle(), Sphere(), ProjectivePlane()]


@pytest.mark.parametrize(
    ("turns", "unit", "text"),
    [
        (0.5, "radians", "π"),
        (-0.25, "radians", "−π/2"),
        (0, "radians", "0"),
        (0.125, "degrees", "45°"),
        (0.25, "turns", "0.25"),
    ],
)
def test_angles_are_written_in_their_unit(turns, unit, text):
    assert angle_text(turns, unit) == text


def test_measures_are_named():
    assert measure_label(SPACES[0], "natural") == "density, per degree²"
    assert measure_label(SPACES[2], "natural") == "density, per steradian"
    assert "uniform" in measure_label(SPACES[2], "uniform")
    assert "square" in measure_label(SPACES[1], "square")


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
    degrees = SPACES[0]
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
    space = SPACES[0]
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
    space = SPACES[0]
    where = space.to_chart([[-63.0, -43.0], [170.0, 300.0]])
    np.testing.assert_allclose(
        view_of(space).places(where), (np.array([[-63, -43], [170, -60]]) + 180) / 360
    )
    around = view_of(space, center=(180, 180))
    np.testing.assert_allclose(around.places(where), np.array([[297, 317], [170, 300]]) / 360)
    back = around.to_chart(torch.tensor(around.places(where)))
    np.testing.assert_allclose(space.project(back), where, atol=1e-12)
