"""The benchmarks: what they need, rivals' densities in our unit, and published figures."""

import importlib
import itertools
import json
import math
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats
from scipy.spatial.transform import Rotation

from density.quick_fits import quick_fits
from orbiflow.density import DensityEstimator, Mixture
from orbiflow.tiles import signed_area

ROOT = Path(__file__).parents[2]
BENCHMARKS = ROOT / "benchmarks"
WANTING = {
    "density_record.py": "the Top500 backbones",
    "escherization.py": "the paper's distorted PNGs",
}


@pytest.fixture(name="module")
def module_fixture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Any]:
    """Benchmarks by name, read anew and forgotten, as in a process of its own."""
    monkeypatch.setenv("ORBIFLOW_DATA", str(tmp_path))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for path in BENCHMARKS.glob("*.py"):
        monkeypatch.setitem(sys.modules, path.stem, sys)
        monkeypatch.delitem(sys.modules, path.stem)
    yield importlib.import_module
    for path in BENCHMARKS.glob("*.py"):
        sys.modules.pop(path.stem, None)


def test_the_nine_goals_and_their_figures_are_in_the_repository(module) -> None:
    common = module("common")
    figures = common.published("nine_goals")
    assert tuple(figures) == common.GOALS
    for name in common.GOALS:
        target = common.goal(name)
        assert len(target.outline) == int(name.rpartition("_")[2])
        assert target.y_down
        assert target.notes == ()
        assert signed_area(target.normal) == pytest.approx(1)
        for method in ("est", "arap"):
            assert all(0 < value < 1 for value in figures[name][method].values())
    licence = (ROOT / "examples" / "silhouettes" / "nagata" / "LICENSE").read_text()
    assert licence.startswith("MIT License\n\nCopyright (c) 2022 Yuichi Nagata")
    document = json.loads((BENCHMARKS / "data" / "published.json").read_text())
    assert all(section["note"] for section in document.values())  # where they come from
    # the best similarity undoes one
    outline = common.goal("bat_60").outline
    turned = 3 * outline @ np.array([[0.6, -0.8], [0.8, 0.6]]) * (1, -1) + (5, 7)
    assert common.aligned(turned, outline) == pytest.approx(outline, abs=2.0)


@pytest.mark.parametrize("name", WANTING)
@pytest.mark.usefixtures("module")
def test_what_is_missing_is_said_in_one_line(name: str, monkeypatch, capsys) -> None:
    arguments = ["--distorted"] if name == "escherization.py" else ["narrow", "--data", "proline"]
    monkeypatch.setattr(sys, "argv", [str(BENCHMARKS / name), *arguments])
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(BENCHMARKS / name), run_name="__main__")
    assert left.value.code == 2
    out, err = capsys.readouterr()
    assert err == ""
    (line,) = out.splitlines()
    assert line.startswith(f"{WANTING[name]} are not here (")
    assert line.endswith("docs/benchmarks.md says where to get them")


def test_the_page_names_every_benchmark() -> None:
    page = (ROOT / "docs" / "benchmarks.md").read_text()
    helpers = {"common", "density_data", "density_integral", "density_kde", "density_known"}
    helpers |= {"density_limits", "rivals"}
    for path in BENCHMARKS.glob("*.py"):
        assert path.stem in helpers or f"benchmarks/{path.name}" in page


def uniform_rows(space: str, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    if space == "torus":
        return rng.uniform(-10, 10, (count, 3))
    if space == "rotation-space":
        return Rotation.random(count, rng=rng).as_quat()
    lat = np.degrees(np.arcsin(rng.uniform(-1, 1, count)))
    return np.stack([lat, rng.uniform(-180, 540, count)], axis=1)


@pytest.mark.parametrize(
    ("space", "volume"),
    [("torus", (2 * math.pi) ** 3), ("sphere", 4 * math.pi), ("rotation-space", 1.0)],
)
def test_what_is_even_is_even_in_the_box(module, space: str, volume: float) -> None:
    box = module("rivals").box_of(space, 3)
    rows = box.lay(uniform_rows(space, 4000))
    assert rows.shape == (4000, box.dim)
    assert (abs(rows) <= math.pi + 1e-12).all()
    even = (rows + math.pi) / (2 * math.pi)
    for axis in range(box.dim):
        if space != "torus":
            assert scipy.stats.kstest(even[:, axis], "uniform").pvalue > 1e-3
    # the even density of the box is the even density of the space
    assert box.shift - box.dim * math.log(2 * math.pi) == pytest.approx(-math.log(volume))


def test_the_true_density_of_mixtures_of_rotations_has_the_mean_one(module) -> None:
    rows, _, log_density, *_ = module("density_known").turned(16, 2000)
    other = Rotation.random(20_000, rng=np.random.default_rng(1)).as_quat()
    ratio = np.exp(log_density(other))
    assert ratio.mean() == pytest.approx(1, abs=5 * ratio.std() / len(ratio) ** 0.5)
    assert log_density(rows) == pytest.approx(log_density(-rows))
    # by Jensen's inequality, and by three nats
    assert log_density(rows).mean() > 3


@pytest.mark.parametrize("space", ["torus", "sphere", "rotation-space"])
def test_kernels_of_scikit_learn_integrate_to_one(module, space: str) -> None:
    rng = np.random.default_rng(2)
    if space == "torus":
        angle = rng.normal(0, 0.6, (60, 2))
        line = (np.arange(200) + 0.5) / 200 * 2 * math.pi
        grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
        rows, points = (
            np.stack([np.cos(own), np.sin(own)], axis=2).reshape(len(own), 4)
            for own in (angle, grid)
        )
        volume = (2 * math.pi) ** 2
    else:
        # many even points of a sphere, with an error of one over the root of their number
        width = 3 if space == "sphere" else 4
        rows, points = (rng.normal(size=(count, width)) for count in (60, 40_000))
        rows[:, 0] = 2 * abs(rows[:, 0])
        rows, points = (own / np.linalg.norm(own, axis=1, keepdims=True) for own in (rows, points))
        volume = 4 * math.pi if space == "sphere" else 1.0
    log, _ = module("rivals").scikit_learn(rows[:40], rows[40:], signed=space != "rotation-space")
    density = np.exp(log(points)) * volume
    error = 0 if space == "torus" else density.std() / len(density) ** 0.5
    assert density.mean() == pytest.approx(1, abs=5 * error + 2e-3)


def test_side_chains_of_all_dimensions_are_in_the_repository(module) -> None:
    for dim in range(4, 15):
        drawn = module("density_data").sidechains(dim)
        assert drawn.data.shape[1] == dim
        assert len(drawn.data) == len(drawn.group) > 1_000
        assert abs(drawn.data).max() <= math.pi
        assert len(np.unique(drawn.data, axis=0)) > 0.99 * len(drawn.data)


def test_the_known_density_is_a_sum_over_paths(module) -> None:
    drawn = module("density_known").hidden_markov_chain(2)
    grid = (np.arange(96) + 0.5) / 96 * 2 * np.pi - np.pi
    points = np.array(list(itertools.product(grid, grid)))
    assert np.exp(drawn.log_density(points)).mean() * 4 * np.pi**2 == pytest.approx(1, abs=1e-6)
    shares = np.exp(drawn.log_density(points)).reshape(96, 96).sum(axis=1)
    counts = np.histogram(drawn.data[:, 0], 96, (-np.pi, np.pi))[0]
    assert abs(shares / shares.sum() - counts / counts.sum()).sum() < 0.2


def test_groups_stay_on_one_side(module) -> None:
    halves, drawn = module("density_default").halves, module("density_data").Drawn
    for seed in range(5):
        group = np.random.default_rng(seed).integers(60, size=900)
        rows = np.stack([np.arange(900.0), group], axis=1)
        train, test = halves(drawn(rows, "torus"), seed, group)
        assert len(train) + len(test) == 900
        assert 90 <= len(test) < 150
        assert not set(train[:, 1]) & set(test[:, 1])


def test_narrow_kernels_are_those_of_the_kernel_estimate(module) -> None:
    limits, kde = module("density_limits"), module("density_kde")
    rng = np.random.default_rng(0)
    train = rng.vonmises(0.0, 3e4, (400, 3))
    test = rng.vonmises(0.0, 3e4, (50, 3))
    globe = np.degrees(train[:, :2]), np.degrees(test[:, :2])
    for round_, rows, places in ((False, train, test), (True, *globe)):
        own = limits.narrow_log_density(rows, places, 1e5, round_=round_)
        other = kde.KernelDensity(rows, 1e5, round_=round_).score_samples(places)
        assert own == pytest.approx(other, abs=1e-3)


def test_repeated_rows_are_worth_any_number_of_nats(module) -> None:
    limits = module("density_limits")
    rng = np.random.default_rng(1)
    places = rng.uniform(-np.pi, np.pi, (300, 2))
    parts = [places[rng.integers(300, size=n)] for n in (600, 200, 200)]
    kappas = np.array([1e6, 1e10])
    _, found = limits.with_narrow(*parts, kappas, round_=False)
    assert found[1][0] < found[0][0] - 1
    parts = [rng.uniform(-np.pi, np.pi, (n, 2)) for n in (600, 200, 200)]
    bare, found = limits.with_narrow(*parts, kappas, round_=False)
    assert [nll for nll, _ in found] == pytest.approx([bare, bare], abs=0.02)


def test_entropy_by_neighbours(module) -> None:
    rng = np.random.default_rng(2)
    found = module("density_limits").neighbour_entropy(rng.uniform(-9, 9, (20_000, 2)) * np.pi / 9)
    assert found == pytest.approx(2 * math.log(2 * math.pi), abs=0.05)


def test_the_integral_is_seen_from_values(module, monkeypatch) -> None:
    quick_fits(monkeypatch)
    monkeypatch.setattr(module("density_integral"), "GRID", 128)
    monkeypatch.setattr(module("density_integral"), "LOOKED_AT", 20)
    integral = module("density_integral").integral
    rng = np.random.default_rng(4)
    rows = rng.vonmises(rng.uniform(-3, 3, (3, 2))[rng.integers(3, size=240)], 20.0)
    rows[:40] = rows[40:80]  # so that there are narrow kernels
    estimator = DensityEstimator("torus", components="kernels,mixture,chains", seed=0)
    density = estimator.fit(rows).density_
    assert isinstance(density, Mixture)
    found = integral(density)
    assert found.value == pytest.approx(1, abs=1e-4)
    assert found.worst < 1e-6
    # and it would be seen if a constant were wrong
    for part, weight in zip(density.components, density.weights.tolist(), strict=True):
        if part.kind == "uniform" or weight < 0.01:
            continue
        method = "log_chart" if part.kind == "chains" else "log_density"
        right = getattr(type(part), method)
        with monkeypatch.context() as patched:
            patched.setattr(type(part), method, lambda self, *x, own=right: own(self, *x) + 0.1)
            off = 0.1 * weight
            assert integral(density).value - found.value == pytest.approx(off, rel=0.1)
