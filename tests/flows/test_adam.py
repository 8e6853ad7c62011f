"""Tests of steps down a gradient."""

import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.flows import Adam


@given(st.integers(0, 1000), st.floats(1e-4, 1.0))
def test_steps_are_those_of_torch(seed: int, rate: float) -> None:
    draws = torch.Generator().manual_seed(seed)
    first = [torch.randn(3, 2, generator=draws), torch.randn(4, generator=draws), torch.zeros(2)]
    ours, theirs = ([tensor.clone().requires_grad_() for tensor in first] for _ in range(2))
    adam = Adam(ours)
    optimizer = torch.optim.Adam(theirs, lr=rate)
    for _ in range(5):
        adam.step((ours[0].sin().sum() + ours[1].exp().sum()), [rate] * 3)
        optimizer.zero_grad()
        (theirs[0].sin().sum() + theirs[1].exp().sum()).backward()
        optimizer.step()
    assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))
    assert torch.equal(ours[2], torch.zeros(2))  # the loss does not hang on it
