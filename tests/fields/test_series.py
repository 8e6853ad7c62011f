"""The separable Fourier sum against naive sums, mpmath and numerical derivatives."""

import itertools
import math

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.fields.fourier import differentiate, evaluate, evaluate_plainly
from strategies import central_difference, largest, random_tensor, seeds

orders = st.lists(st.integers(0, 4), min_size=1, max_size=3)


def weights_and_points(seed, orders, *, stacks=2, components=3, points=4):
    shape = (stacks, components, *(2 * k + 1 for k in orders))
    return (
        random_tensor(seed, *shape, size=1.0),
        random_tensor(seed + 1, stacks, len(orders), points, size=2.0),
    )


def harmonic(index, order, u, lib=math):
    """Entry `index` of 1, cos 2 pi u, ..., cos 2 pi K u, sin 2 pi u, ..., sin 2 pi K u."""
    if index <= order:
        return lib.cos(2 * lib.pi * index * u)
    return lib.sin(2 * lib.pi * (index - order) * u)


def naive_value(weights, orders, u, lib=math):
    """One series at one point, mode by mode."""
    total = lib.mpf(0) if lib is mpmath else 0.0
    for index in itertools.product(*(range(2 * k + 1) for k in orders)):
        term = float(weights[index])
        for i, k, x in zip(index, orders, u, strict=True):
            term = term * harmonic(i, k, x, lib)
        total = total + term
    return total


@given(seeds, orders)
def test_values_are_those_of_the_sum_over_modes(seed, orders):
    weights, u = weights_and_points(seed, orders, stacks=2, components=2, points=2)
    values = evaluate(weights, u)
    for s, c, n in itertools.product(range(2), range(2), range(2)):
        expected = naive_value(weights[s, c], orders, u[s, :, n].tolist())
        assert values[s, c, n].item() == pytest.approx(expected, abs=2e-12)


def test_values_are_right_to_the_last_digits():
    weights, u = weights_and_points(7, [10, 10], stacks=1, components=1, points=3)
    values = evaluate(weights, u)
    with mpmath.workdps(40):
        for n in range(3):
            point = [mpmath.mpf(x) for x in u[0, :, n].tolist()]
            exact = naive_value(weights[0, 0], [10, 10], point, mpmath)
            assert abs(values[0, 0, n].item() - exact) < 1e-13 * weights[0, 0].abs().sum().item()


@given(seeds, orders)
def test_values_are_the_same_with_and_without_gradients(seed, orders):
    weights, u = weights_and_points(seed, orders)
    tracked = evaluate(weights.requires_grad_(), u)
    with torch.no_grad():
        torch.testing.assert_close(evaluate(weights, u), tracked.detach(), rtol=0, atol=1e-13)
    torch.testing.assert_close(evaluate_plainly(weights, u), tracked, rtol=0, atol=1e-12)


@pytest.mark.parametrize("orders", [[3], [2, 3], [2, 1, 2], [0, 2], [1, 0]])
def test_first_derivatives_pass_gradcheck(orders):
    inputs = [a.requires_grad_() for a in weights_and_points(3, orders)]
    assert torch.autograd.gradcheck(evaluate, inputs, atol=1e-7, rtol=1e-6)


@pytest.mark.parametrize("orders", [[2], [2, 1], [1, 1, 1]])
def test_second_derivatives_pass_gradgradcheck(orders):
    inputs = [a.requires_grad_() for a in weights_and_points(4, orders, points=2)]
    assert torch.autograd.gradgradcheck(evaluate, inputs, atol=1e-6, rtol=1e-5)


def test_a_gradient_is_the_same_whether_or_not_it_is_to_be_differentiated_again():
    # points that depend on the weights, as they do inside an integrator
    weights, u = weights_and_points(6, [2, 2])
    weights.requires_grad_()
    moved = u + 0.1 * evaluate(weights, u)[:, :2]
    total = evaluate(weights, moved).sin().sum()
    (once,) = torch.autograd.grad(total, weights, retain_graph=True)
    (again,) = torch.autograd.grad(total, weights, create_graph=True)
    torch.testing.assert_close(again.detach(), once, rtol=1e-12, atol=1e-12)


@given(seeds, orders, st.data())
def test_differentiated_weights_give_the_derivative(seed, orders, data):
    dim = len(orders)
    axis = data.draw(st.integers(0, dim - 1))
    weights, u = weights_and_points(seed, orders, stacks=1)
    slopes = central_difference(lambda p: evaluate(weights, p.mT[None])[0].mT, u[0].mT)
    derived = evaluate(differentiate(weights, axis, dim), u)[0]
    torch.testing.assert_close(derived, slopes[..., axis].mT, rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize(("dtype", "away"), [(torch.float64, 2.0**24), (torch.float32, 2.0**10)])
@pytest.mark.parametrize("which", [evaluate, evaluate_plainly])
def test_points_whole_periods_away_have_the_same_values(dtype, away, which):
    weights = random_tensor(0, 1, 2, 21, 21, dtype=dtype)
    u = torch.tensor(np.random.default_rng(1).integers(0, 4096, (1, 2, 9)) / 4096, dtype=dtype)
    assert torch.equal((u + away) - away, u)  # the shift itself is exact
    scale = float(weights.abs().sum())
    error = largest(which(weights, u + away) - which(weights, u))
    assert error <= 4 * torch.finfo(dtype).eps * scale


@given(seeds)
def test_single_precision_is_close_to_double(seed):
    weights, u = weights_and_points(seed, [10, 10])
    error = (evaluate(weights.float(), u.float()) - evaluate(weights, u)).abs().max()
    # the points themselves are rounded: frequency 10 multiplies that by 2 pi 10
    assert float(error) <= 2e-4 * float(weights.square().sum((-1, -2)).max().sqrt())
