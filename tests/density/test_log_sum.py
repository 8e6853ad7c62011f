"""Sums of exponentials without slow exponentials."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density.models import log_sum_exp, shares_of

seeds = st.integers(0, 2**31 - 1)
sizes = st.floats(0.0, 6.0)


def table(seed: int, size: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    """Logarithms (7, 30) of either sign, up to 10^size."""
    generator = torch.Generator().manual_seed(seed)
    return 10**size * torch.randn(7, 30, generator=generator, dtype=dtype)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@given(seed=seeds, size=sizes)
def test_they_are_those_of_torch(dtype: torch.dtype, seed: int, size: float) -> None:
    given_ = table(seed, size, dtype)
    kept = given_.clone()
    torch.testing.assert_close(log_sum_exp(given_), given_.logsumexp(dim=-1))
    torch.testing.assert_close(shares_of(given_), given_.softmax(dim=-1), rtol=1e-5, atol=1e-30)
    assert torch.equal(given_, kept)


@given(seed=seeds, size=st.floats(0.0, 1.5))
def test_gradients_are_shares(seed: int, size: float) -> None:
    given_ = table(seed, size).requires_grad_()
    (gradient,) = torch.autograd.grad(log_sum_exp(given_).sum(), given_)
    assert torch.allclose(gradient, given_.softmax(dim=-1), atol=1e-30)


def test_terms_that_are_nothing() -> None:
    empty = -math.inf
    assert log_sum_exp(torch.tensor([empty, 1.0, empty])).item() == pytest.approx(1.0)
    nothing = log_sum_exp(torch.tensor([empty, empty]))
    assert math.isfinite(nothing)
    assert nothing < -1e38
    assert math.isnan(log_sum_exp(torch.tensor([0.0, math.nan])))
