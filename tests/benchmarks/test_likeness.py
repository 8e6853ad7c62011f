"""The scorer of deformation energies, and the arithmetic of blind comparisons."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from orbiflow.geometry import resampled

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NAMES = ("common", "likeness_tiles", "likeness_energy", "likeness_blind")


@pytest.fixture(name="load")
def load_fixture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Benchmarks by name, imported anew."""
    monkeypatch.setenv("ORBIFLOW_DATA", str(tmp_path))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)


def similar(ring: np.ndarray, mirrored: bool) -> np.ndarray:
    turned = 3 * ring @ np.array([[0.6, -0.8], [0.8, 0.6]]) + (5, 7)
    return turned[::-1] * (1, -1) if mirrored else turned


@pytest.mark.parametrize("name", ["bat_60", "spider_120"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_similar_copy_costs_nothing(load, name: str, mirrored: bool) -> None:
    outline = np.asarray(load("common").goal(name).normal)
    scorer = load("likeness_energy").Scorer(outline)
    copy = similar(np.roll(outline, 17, axis=0), mirrored)
    assert scorer.of_vertices(copy) == pytest.approx(0, abs=1e-12)
    # points miss the vertices: the energy is small, not nothing
    points = similar(np.roll(resampled(outline, 240), 31, axis=0), mirrored)
    assert scorer.of_points(points) < 0.02
    fine = resampled(outline, 600, 0.3)
    own = similar(fine, mirrored=False)
    assert scorer.of_images(np.roll(own, 9, 0), np.roll(fine, 9, 0)) < 0.004


def test_energy_is_that_of_the_strain(load) -> None:
    """Stretched by (1 + e) along x and 1 / (1 + e) along y: 2 e^2 times the area, no rotation.

    Cotangent weights integrate the Dirichlet energy of linear maps, here e^2 + e^2, whatever the
    mesh; clipping changes a little.
    """
    outline = np.asarray(load("common").goal("penguin_60").normal)
    scorer = load("likeness_energy").Scorer(outline)
    stretched = outline * (1.02, 1 / 1.02)
    assert scorer.of_vertices(stretched) == pytest.approx(2 * 0.02**2, rel=0.15)
