"""A fit by evidence: parts chosen, normalised, invariant, the same again, saved and read."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import orbiflow.density as od
from density.blends import kernels_of, stored, two_clusters
from orbiflow.density.fitting import COMPONENTS
from orbiflow.density.models import midpoints
from refusals import refused

QUICK: dict[str, Any] = {
    "max_frequency": 2, "segments": 2, "iterations": 5, "roughness": (1e-3,)
}  # fmt: skip


def smooth(name: str, count: int = 300, seed: int = 0) -> torch.Tensor:
    return two_clusters(od.make_space(name), count, seed)


@pytest.mark.parametrize("name", ["torus", "projective-plane"])
def test_a_fit_by_evidence(name: str, tmp_path: Path, monkeypatch) -> None:
    rows, folds = (300, 10) if name == "torus" else (60, 2)
    if name == "torus":
        monkeypatch.setattr("orbiflow.density.fitting.held_out.USED", ((600, 10),))
    space, said = od.make_space(name), []
    settings = od.DensitySettings(**QUICK)
    density, report = od.fit_automatic(
        space, smooth(name), settings, progress=lambda done, what: said.append((done, what))
    )
    assert isinstance(density, od.Mixture)
    grid = midpoints(space, 80)
    with torch.no_grad():
        values = density.log_prob(grid)
        assert float(values.exp().mean()) == pytest.approx(1, abs=5e-3)
        held = float(density.log_prob(smooth(name, 1000, 1)).mean())
    assert report.mass == pytest.approx(1, abs=1e-3)
    assert report.weights is not None
    assert sum(report.weights.values()) == pytest.approx(1)
    assert held == pytest.approx(-report.validation_nll, abs=0.15 if name == "torus" else 0.6)
    assert held > -report.start_nll + 0.5
    wanted = {"flow", "kernels", "mixture"} | ({"chains"} if name == "torus" else set())
    assert {part.name for part in report.components} == wanted
    assert sum(part.share for part in report.components) == pytest.approx(1, abs=0.05)
    assert report.repeats is not None
    assert report.repeats.rows == 0
    assert report.notes[0].startswith(f"chosen by {rows} rows held out, in {folds} parts")
    assert [done for done, _ in said] == sorted(done for done, _ in said)
    assert any(f"held-out part 2 of {folds}: mixture" in what for _, what in said)
    back = stored(density, tmp_path)
    with torch.no_grad():
        assert torch.equal(back.log_prob(grid), values)
    draws = [d.sample((50,), torch.Generator().manual_seed(0)) for d in (density, back)]
    assert torch.equal(*draws)
    for element in space.group.cosets:
        image = density.log_prob(space.project(element(draws[0])))
        torch.testing.assert_close(image, density.log_prob(draws[0]), rtol=0, atol=1e-7)


def test_the_same_seed_gives_the_same_density() -> None:
    space, at = od.make_space("sphere"), smooth("sphere", 9, 9)
    parts: Any = ("kernels", "mixture")
    settings = [od.DensitySettings(components=parts, seed=seed) for seed in (1, 1, 2)]
    with torch.no_grad():
        one, same, other = (
            od.fit_automatic(space, smooth("sphere", 40), s)[0].log_prob(at) for s in settings
        )
    assert torch.equal(one, same)
    assert not torch.equal(one, other)


def test_repeated_places_are_mass_unless_said_otherwise() -> None:
    rng = np.random.default_rng(0)
    space, points = od.make_space("torus"), smooth("torus", 300)
    points = torch.cat([points, points[torch.tensor(rng.integers(0, 10, 200))]])
    at = points[300:]
    values = {}
    for repeats in ("places", "rounding"):
        settings = od.DensitySettings(components=("kernels",), repeats=repeats)
        density, report = od.fit_automatic(space, points, settings)
        with torch.no_grad():
            values[repeats] = float(density.log_prob(at).mean())
        assert "repeat an earlier one" in report.notes[-1]
    assert values["places"] > values["rounding"] + 3


@pytest.mark.parametrize(("close", "spiky"), [(2, False), (60, True)])
def test_spikes_are_of_places_and_not_of_accidents(close: int, spiky: bool) -> None:
    rng, space = np.random.default_rng(7), od.make_space("klein-bottle")
    rows = np.stack([rng.vonmises(0.3, 4.0, 400), rng.vonmises(1.0, 3.0, 400)], axis=1)
    rows[1:close:2] = rows[0:close:2] + 1e-4
    chosen = od.DensitySettings(components=("kernels", "mixture"))
    density, _ = od.fit_automatic(space, space.to_chart(rows), chosen)
    narrow = kernels_of(density).concentrations.amax(dim=1) > 1e5
    assert (int(narrow.sum()) > 20) == spiky  # some follow the distance to the nearest row


@pytest.mark.parametrize("part", COMPONENTS[1:])
def test_each_part_alone(part: str) -> None:
    estimator = od.DensityEstimator("torus", components=part)
    dim = 4 if part == "network" else 3
    angles = np.random.default_rng(0).vonmises([0.0, 1.0, 2.0, 3.0][:dim], 3.0, (200, dim))
    estimator.fit(angles)
    assert [p.name for p in estimator.report_.components] == [part]
    assert estimator.score(angles) > -dim * math.log(2 * math.pi) + 0.5
    assert [len(estimator.density_.sample((count,))) for count in (0, 1, 3)] == [0, 1, 3]


@pytest.mark.usefixtures("whole_fits")
def test_few_points() -> None:
    count = 10
    points = smooth("torus", count)
    density, report = od.fit_automatic(od.Torus(2), points)
    assert report.validation == count
    assert report.notes[0].startswith("chosen by 10 rows held out, in 10 parts")
    with torch.no_grad():
        assert bool(density.log_prob(midpoints(density.space, 40)).isfinite().all())


def test_what_cannot_be_chosen_is_refused() -> None:
    with refused("components"):
        od.DensitySettings(components=("trees",))  # type: ignore[arg-type]
    with refused("repeats"):
        od.DensitySettings(repeats="noise")  # type: ignore[arg-type]
    with refused("chains"):
        od.fit_automatic(
            od.make_space("sphere"), smooth("sphere"), od.DensitySettings(components=("chains",))
        )
    with refused("flow", "3"):
        od.DensityEstimator("torus", unit="degrees", components="flow,chains").fit(
            np.random.default_rng(0).uniform(0, 360, (50, 5))
        )
    with refused("different", "10", "3", "30"):
        od.fit_automatic(od.make_space("torus"), torch.rand(3, 2).repeat(10, 1))


def test_parts_for_new_groups() -> None:
    """Rows of a group lie within a degree: narrow kernels are right for its rows, not for others."""
    rng, space = np.random.default_rng(3), od.make_space("torus")
    middles = rng.vonmises(0.0, 2.0, (60, 2))
    label = np.repeat(np.arange(60), 8)
    points = space.to_chart(middles[label] + 0.01 * rng.normal(size=(480, 2)))
    new = space.to_chart(rng.vonmises(0.0, 2.0, (2000, 2)))
    chosen = od.DensitySettings(components=("kernels", "mixture"))
    alone, _ = od.fit_automatic(space, points, chosen)
    grouped, report = od.fit_automatic(space, points, chosen, groups=label)
    assert "of whole groups, of which there are 60" in " ".join(report.notes)
    assert float(grouped.log_prob(new).mean()) > float(alone.log_prob(new).mean()) + 0.5
