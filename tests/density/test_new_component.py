"""A new kind of component needs one class in one file: here, in a test's own."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
import torch
from scipy import stats
from torch import Tensor

import orbiflow.density as od
from density.blends import even_grid, random_chains, random_kernels, stored
from orbiflow.density.inference import log_prob_observed
from orbiflow.density.pictures import density_on_grid
from orbiflow.errors import InputFileError
from refusals import refused
from sealed import sealed


# The walk: from here ...
class Wave(od.Density, kind="wave"):
    """1 + a cos(2 pi x) in the first angle of a torus."""

    def __init__(self, space: od.Space, height: float) -> None:
        super().__init__(space)
        self.height = height

    def log_chart(self, points: Tensor) -> Tensor:
        return (1 + self.height * (2 * math.pi * points[..., 0]).cos()).log()

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        points = self.space.uniform(count, generator)
        odds = torch.rand(count, dtype=torch.float64, generator=generator)
        # half a turn away the density is as much below 1 as it is above it here
        points[:, 0] += torch.where(2 * odds > self.log_chart(points).exp(), 0.5, 0.0)
        return self.space.project(points)

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        del seed
        return self.log_chart(points[:, [axes.index(0)]]) if 0 in axes else 0 * points[:, 0]

    def header(self) -> dict[str, Any]:
        return {"height": self.height}

    @classmethod
    def from_header(
        cls, space: od.Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del tensors
        return cls(space, float(header["height"]))


# ... to here: one file, some 30 lines, and nothing else.

TORUS = od.Torus(2)


def mixture() -> od.Mixture:
    """With a wave, and components of three other kinds."""
    rng = np.random.default_rng(0)
    parts = [
        Wave(TORUS, 0.8),
        random_kernels(rng, TORUS),
        od.UniformDensity(TORUS),
        random_chains(rng, TORUS),
    ]
    return od.Mixture(parts, [0.5, 0.2, 0.1, 0.2])


def test_it_is_evaluated_saved_drawn_and_moved_beside_others(tmp_path: Path) -> None:
    density, grid = mixture(), even_grid(96, 2)
    values = density.log_prob(grid).exp()
    assert float(values.mean()) == pytest.approx(1, abs=1e-6)
    pairs = zip(density.weights, density.components, strict=True)
    torch.testing.assert_close(values, sum(w * own.log_prob(grid).exp() for w, own in pairs))
    assert density.weight_of_kind["wave"] == 0.5
    assert "wave 50.0%" in repr(density)
    _, slopes = od.log_density_gradient(density, [[0.3, 0.4]])
    assert slopes.shape == (1, 2)
    assert torch.equal(stored(density, tmp_path).log_prob(grid).exp(), values)
    line = torch.linspace(0.01, 0.99, 30, dtype=torch.float64)
    assert density_on_grid(density, line, line, "uniform").shape == (30, 30)
    assert od.highest_density_region(density, 0.5, samples=2000).size > 0
    assert density.to(torch.float32).sample(3).dtype == torch.float32


def test_its_samples_follow_it() -> None:
    first = Wave(od.Torus(1), 0.8).sample(4000, torch.Generator().manual_seed(0))[:, 0].numpy()
    cumulative = lambda x: x + 0.8 * torch.tensor(2 * math.pi * x).sin().numpy() / (2 * math.pi)  # noqa: E731
    assert stats.kstest(first, cumulative)[1] > 0.01  # type: ignore[operator]


def test_it_has_marginal_and_conditional_densities() -> None:
    density, line = mixture(), even_grid(64, 1)
    joint = density.log_prob(even_grid(64, 2)).exp().reshape(64, 64)
    for axis in (0, 1):
        found = od.marginal(density, axis)
        torch.testing.assert_close(
            found.log_prob(line).exp(), joint.mean(dim=1 - axis), rtol=1e-4, atol=1e-4
        )
    given = od.conditional(density, {1: 0.25}).log_prob(line).exp()
    expected = joint[:, 16] / joint[:, 16].mean()
    torch.testing.assert_close(given, expected, rtol=1e-3, atol=1e-3)
    rows = torch.tensor([[0.3, math.nan]], dtype=torch.float64)
    own = od.marginal(density, 0).log_prob(rows[:, :1])
    torch.testing.assert_close(log_prob_observed(density, rows), own, rtol=1e-4, atol=1e-4)


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    class Bare(Wave):
        """Of no kind of its own."""

    with refused("Bare"):
        od.density_to_bytes(od.Mixture([Bare(TORUS, 0.1)], [1.0]))
    path = tmp_path / "density.safetensors"
    path.write_bytes(sealed(od.density_to_bytes(Wave(TORUS, 0.1)).replace(b"wave", b"wove")))
    with refused("wove", kind=InputFileError):
        od.read_density(path)
    with refused("taken"):

        class Second(od.Density, kind="wave"):  # pyright: ignore[reportUnusedClass]
            """Another class of the same kind."""

    class Silent(od.Density):
        """Without marginals."""

    with refused("integrated"):
        od.marginal(Silent(TORUS), 0)


def test_its_parts_are_walked_through_mixtures_of_mixtures() -> None:
    inner = mixture()
    outer = od.Mixture([inner, od.UniformDensity(TORUS)], [0.5, 0.5])
    found = [(weight, part.kind) for weight, part in outer.parts()]
    kinds = ("wave", "kernels", "uniform", "chains", "uniform")
    assert found == list(zip((0.25, 0.1, 0.05, 0.1, 0.5), kinds, strict=True))
    at, pixel = even_grid(7, 2), torch.tensor(2.0)
    wide = outer.averaged_over(lambda _points: pixel)
    assert [part.kind for _, part in wide.parts()] == [*kinds]
    assert not torch.allclose(wide.log_prob(at), outer.log_prob(at))
    wave = inner.components[0]
    assert wave.averaged_over(lambda _points: pixel) is wave
    assert not wave.is_narrower_than(lambda _points: pixel)
    assert inner.components[1].is_narrower_than(lambda _points: pixel)
