"""How many samples the region of a mass needs, and gets."""

import math

import numpy as np
import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from density.blends import blended, identity_flow
from orbiflow.density import (
    AdaptiveKernels,
    DensityLevels,
    PlotSettings,
    UniformDensity,
    highest_density_region,
    make_space,
    resolvable_masses,
)
from orbiflow.density.regions import samples_for
from orbiflow.density.regions.settings import (
    GOOD_EXPECTED,
    MAX_DEFAULT_SAMPLES,
    MAX_SAMPLES,
    MIN_EXPECTED,
    SAMPLES,
)
from refusals import refused

masses = st.floats(2e-5, 1 - 2e-5)


@given(st.lists(masses, max_size=4))
def test_what_suits_the_masses_is_never_too_few(shares: list[float]) -> None:
    count = samples_for(shares)
    assert SAMPLES <= count <= MAX_DEFAULT_SAMPLES
    assert samples_for(shares, count) == count
    rarest = min((min(share, 1 - share) for share in shares), default=0.5)
    assert count in (SAMPLES, MAX_DEFAULT_SAMPLES) or count == pytest.approx(
        GOOD_EXPECTED / rarest, abs=1
    )


@given(masses, st.integers(1000, MAX_SAMPLES))
def test_at_least_ten_are_expected_on_either_side(mass: float, count: int) -> None:
    expected = min(mass, 1 - mass) * count
    assume(abs(expected - MIN_EXPECTED) > 1e-6)
    low, high = resolvable_masses(count)
    assert (low <= mass <= high) == (expected > MIN_EXPECTED)
    if expected > MIN_EXPECTED:
        assert samples_for([0.5, mass], count) == count
    else:
        with refused(count):
            samples_for([0.5, mass], count)


def test_the_number_that_a_message_names_is_enough() -> None:
    with refused("0.99995", "1", "200000"):
        samples_for([0.99995], 20_000)
    assert samples_for([0.99995], 200_000) == 200_000
    with refused("5e-05", "0"):
        samples_for([5e-5], 20_000)
    with refused("1e-06", "0.999999"):
        samples_for([1 - 1e-7])
    assert samples_for([0.999999], MAX_SAMPLES) == MAX_SAMPLES


def test_far_out_the_mass_and_the_interval_are_right() -> None:
    space = make_space("torus", axes=1)
    kernels = AdaptiveKernels(
        space,
        torch.tensor([[0.5]]).double(),
        torch.tensor([[9.0]]).double(),
        torch.ones(1).double(),
    )
    shares = torch.tensor([0.0, 0.999, 0.001]).double()
    density = blended(space, identity_flow(space), UniformDensity(space), kernels, shares)
    region = highest_density_region(density, 0.9995)  # half of what lies about in the uniform floor
    fresh = DensityLevels(density, samples=1_000_000, seed=1).log_probs
    outside = float(np.mean(fresh < region.log_prob))
    assert outside == pytest.approx(0.0005, abs=5 * math.sqrt(0.0005 / 200_000))
    assert region.error == pytest.approx(math.sqrt(0.0005 / 200_000), rel=0.01)
    coarse = highest_density_region(density, 0.9995, samples=20_000)
    assert coarse.log_prob_low < coarse.log_prob < coarse.log_prob_high


def test_pictures_have_the_same_rule() -> None:
    assert PlotSettings(regions=(0.9995,)).regions == (0.9995,)
    with refused("region_samples", "20000"):
        PlotSettings(regions=(0.9995,), region_samples=10_000)
    with refused("region_samples"):
        PlotSettings(regions=(0.9,), region_samples=MAX_SAMPLES + 1)
