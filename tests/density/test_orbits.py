"""EM on orientations of crystals: images of components near a point do for all images of it."""

from functools import partial

import pytest
import torch

from orbiflow.density import make_space
from orbiflow.density.fitting import Rows, kernels
from orbiflow.density.fitting.orbits import MOST_SINGLE, Orbits
from orbiflow.density.spaces import RotationSpace, Space


def rows_of(space: Space, count: int, *, weighted: bool, seed: int = 0) -> Rows:
    generator = torch.Generator().manual_seed(seed)
    points = space.uniform(count, generator)
    weights = torch.rand(count, generator=generator, dtype=torch.float64) + 0.5
    return Rows(points, weights if weighted else None)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize(("crystal", "specimen"), [("m-3m", "222"), ("6/mmm", None)])
@pytest.mark.parametrize("kappa", [0.01, 30.0, 900.0, 1e5])
def test_a_step_is_that_of_all_images(
    crystal: str, specimen: str | None, weighted: bool, kappa: float
) -> None:
    space = make_space("rotation-space", symmetry=crystal, specimen=specimen)
    assert isinstance(space, RotationSpace)
    rows = rows_of(space, 400, weighted=weighted)
    mean = space.features(rows.points[:5], slice(1))[0]
    sharp = torch.full((5, 1), kappa, dtype=torch.float64) * torch.linspace(0.5, 1.0, 5)[:, None]
    weights = torch.tensor([0.1, 0.2, 0.3, 0.15, 0.25], dtype=torch.float64)
    _, _, away, step = kernels._by_images(space, rows, 5)
    orbits = Orbits(space, rows.points, rows.weights)
    assert torch.allclose(orbits.away(7), away(7), atol=1e-12)
    found, true = orbits.expectation(mean, sharp, weights), step(mean, sharp, weights)
    for own, other in zip(found[:3], true[:3], strict=True):
        assert torch.allclose(own, other, rtol=2e-3, atol=2e-3)
    assert found[3] == pytest.approx(true[3], rel=1e-4)
    if kappa >= 2 * MOST_SINGLE:
        assert found[3] == pytest.approx(true[3], rel=1e-9)


def test_mixtures_are_as_good_as_with_all_images(monkeypatch: pytest.MonkeyPatch) -> None:
    space = make_space("rotation-space", symmetry="432", specimen="222")
    truth = kernels.even_kernels(
        space, space.uniform(3, torch.Generator().manual_seed(4)), 60.0, torch.full((3,), 1 / 3)
    )
    draw = partial(truth.sample, generator=torch.Generator().manual_seed(5))
    rows, fresh = Rows(draw(1_500)), draw(1_000)
    monkeypatch.setattr(kernels, "FIRST_ROWS", 300)
    scores = []
    for many in (8, 10**9):
        monkeypatch.setattr(kernels, "MANY_IMAGES", many)
        fit = kernels.fit_mixture(space, rows, 4, generator=torch.Generator().manual_seed(6))
        scores.append(float(fit.log_prob(fresh).mean()))
    assert scores[0] == pytest.approx(scores[1], abs=0.02)
    assert scores[0] == pytest.approx(float(truth.log_prob(fresh).mean()), abs=0.05)
