"""Networks on periodic features."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.fields import PeriodicFeatures
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import equivariance_error, groups, largest, neural_field, random_tensor


def disturbed(field, seed):
    """The field with random weights everywhere, the last layer included."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in field.parameters():
            noise = torch.randn(parameter.shape, generator=generator, dtype=parameter.dtype)
            parameter.add_(0.3 * noise)
    return field


@settings(max_examples=10)
@given(groups, st.integers(0, 1000))
def test_equivariance_holds_to_rounding(group, seed):
    field = disturbed(neural_field(group, hidden=(8,), seed=seed), seed)
    assert equivariance_error(field, group, random_tensor(seed, 8, group.dim)) < 1e-11


def test_a_new_field_is_zero():
    field = neural_field(wallpaper_group("p4"))
    assert largest(field(random_tensor(0, 10, 2))) == 0.0


@pytest.mark.parametrize(
    ("dim", "max_frequency", "size"), [(1, 3, 6), (2, 1, 8), (2, 2, 24), (3, 1, 26), (4, 2, 16)]
)
def test_features_are_cosines_and_sines_of_half_the_box(dim, max_frequency, size):
    group = CrystallographicGroup.generate(torch.eye(dim).numpy())
    features = PeriodicFeatures(group, max_frequency)
    values = features(random_tensor(0, 50, dim))
    assert features.size == values.shape[-1] == size
    half = size // 2
    torch.testing.assert_close(
        values[:, :half].square() + values[:, half:].square(),
        torch.ones(50, half, dtype=torch.float64),
    )


def test_features_without_a_frequency_are_refused():
    with refused("max_frequency", 0):
        PeriodicFeatures(wallpaper_group("p1"), 0)
