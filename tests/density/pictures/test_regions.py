"""Lines about regions of highest density: where they are, and what is said of them."""

import functools
from typing import Any

import numpy as np
import pytest
import torch
from matplotlib.contour import QuadContourSet
from matplotlib.path import Path as MapPath

import orbiflow.density as od
from density.blends import blended, identity_flow
from orbiflow.density.pictures.frames import view_of
from orbiflow.density.pictures.projections import EqualEarth
from refusals import refused

SPACES = ("torus", "klein-bottle", "sphere", "projective-plane")
MEASURES = ("natural", "square", "uniform")


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbiflow.density.pictures.square._FINE_GRID", 160)
    monkeypatch.setattr("orbiflow.density.pictures.maps._PIXELS", 40_000)


@functools.cache
def broad(name: str) -> od.Mixture:
    """Some broad kernels."""
    space, rng = od.make_space(name), np.random.default_rng(5)
    kernels = od.AdaptiveKernels(
        space,
        space.uniform(4, torch.Generator().manual_seed(2)),
        torch.tensor(rng.uniform(4, 20, (4, 1 if space.is_round else 2))),
        torch.full((4,), 0.25).double(),
    )
    shares = torch.tensor([0.0, 0.8, 0.2]).double()
    return blended(space, identity_flow(space), od.UniformDensity(space), kernels, shares)


@functools.cache
def lines_of(density: od.Mixture, *masses: float) -> list[od.DensityRegion]:
    levels = od.DensityLevels(density, samples=4000)
    return [levels.highest(mass) for mass in masses]


def with_regions(*masses: float, **options: Any) -> od.PlotSettings:
    return od.PlotSettings(regions=masses, region_samples=4000, **options)


def vertices(figure: Any) -> list[np.ndarray]:
    """Of each set of lines in a figure, (N, 2) on the axes."""
    (axes,) = [a for a in figure.axes if any(isinstance(c, QuadContourSet) for c in a.collections)]
    sets = [c for c in axes.collections if isinstance(c, QuadContourSet)]
    return [np.concatenate([p.vertices for p in one.get_paths()]) for one in sets]


@pytest.mark.parametrize(
    ("name", "measure"), list(zip(SPACES, (*MEASURES, "natural"), strict=True))
)
def test_lines_are_where_the_density_is_that_of_the_edge(name: str, measure: str) -> None:
    density = broad(name)
    lines, view = lines_of(density, 0.5, 0.9), view_of(density.space, None, None)
    settings = with_regions(0.9, 0.5, measure=measure)
    picture = od.density_picture(density, settings=settings)
    found = vertices(picture.figure)
    assert len(found) == 2
    for line, places in zip(lines, found, strict=True):  # the smallest first
        points = torch.tensor(places) + torch.tensor([float(low) for low in view.low])
        # away from cone points, where a pixel is large on the sphere
        clear = density.space.log_area(points) - density.space.log_area(points).amax() > -4
        logs = density.log_prob(points[clear], measure="natural")
        assert float((logs - line.log_prob).abs().quantile(0.95)) < 0.05
    assert "hold 50 % (solid) and 90 % (dashed)" in picture.caption


@pytest.mark.parametrize("measure", MEASURES)
def test_lines_on_a_map(measure: str) -> None:
    density = broad("sphere")
    lines, projection = lines_of(density, 0.9), EqualEarth((0.0, 40.0))
    asked: dict[str, Any] = {"projection": "equal-earth", "center": (40.0,)}
    settings = with_regions(0.9, measure=measure, **asked)
    picture = od.density_picture(density, settings=settings, ground="map")
    (places,) = vertices(picture.figure)
    # beyond the outline they are cut off
    places = places[MapPath(projection.outline()).contains_points(places, radius=-0.02)]
    points = density.space.vectors_to_chart(od.to_vectors(projection.inverse(places)))  # type: ignore[attr-defined]
    logs = density.log_prob(points, measure="natural")
    assert float((logs - lines[0].log_prob).abs().quantile(0.95)) < 0.05
    assert "The line is about the smallest region that holds 90 %." in picture.caption


@pytest.mark.parametrize("name", ["torus", "sphere"])
def test_logarithms_are_for_lines_alone(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    called: list[int] = []

    def counted(_: od.Density, values: np.ndarray, *_rest: object) -> np.ndarray:
        called.append(len(values))
        return np.log(values)

    pictures = "orbiflow.density.pictures"
    monkeypatch.setattr(f"{pictures}.grounds.log_natural", counted)
    monkeypatch.setattr(f"{pictures}.square._FINE_GRID", 30)
    monkeypatch.setattr(f"{pictures}.maps._PIXELS", 2000)
    density = broad(name)
    draw = functools.partial(od.density_picture, ground="square" if name == "torus" else "map")
    draw(density)
    assert not called
    draw(density, settings=with_regions(0.5, 0.9))
    assert len(called) == 1


def test_masses_that_cannot_be_drawn(tmp_path: Any) -> None:
    for masses, said in (
        ((0.5, 0.5), "masses"),
        ((0.1, 0.2, 0.3, 0.4, 0.5), "4"),
        ((1.0,), "above 0 1"),
    ):
        with refused(*said.split()):
            od.PlotSettings(regions=masses)
    space = od.make_space("torus", axes=3)
    flat = od.FlowDensity(space, identity_flow(space))
    with refused("regions"):
        od.plot_density(flat, tmp_path / "out", od.PlotSettings(regions=(0.5,)))
