"""Marginal and conditional densities of densities that are derived, and of three angles and more."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from density.blends import even_grid, random_blend
from orbiflow.density import conditional, density_to_bytes, marginal, read_density


def test_the_error_of_the_first_step_is_kept(tmp_path: Path) -> None:
    first = marginal(random_blend(1, 3, network=False), [0, 1])
    first.error = 0.02
    assert marginal(first, 0).error >= 0.02
    assert conditional(first, {1: 0.3}).error > 0.01
    (tmp_path / "d").write_bytes(density_to_bytes(first))
    assert read_density(tmp_path / "d")[0].error == 0.02


@pytest.mark.parametrize("given", [None, {1: 0.3}])
def test_three_angles_ask_the_whole(tmp_path: Path, given: dict[int, float] | None) -> None:
    density = random_blend(2, 4, network=True)
    found = marginal(density, [0, 2, 3]) if given is None else conditional(density, given)
    (tmp_path / "d").write_bytes(density_to_bytes(found))
    again = read_density(tmp_path / "d")[0]
    drawn = again.sample(200, torch.Generator().manual_seed(0))
    assert torch.equal(again.log_prob(drawn[:5]), found.log_prob(drawn[:5]))
    assert drawn.shape == (200, 3)
    axis = marginal(density, 2) if given is None else conditional(density, given, 2)
    twice, line = marginal(again, 1), even_grid(16, 1)
    assert float((twice.log_prob(line) - axis.log_prob(line)).abs().max()) < 0.05
