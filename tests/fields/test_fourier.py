"""Fourier fields and their sums: symmetry, parameters, values, precision."""

import itertools
import math

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.fields import FourierField
from orbiflow.fields.fourier import differentiate, evaluate, evaluate_plainly
from orbiflow.fields.invariants import frequency_set
from orbiflow.symmetry import WALLPAPER_GROUPS, wallpaper_group
from refusals import refused
from strategies import (
    SMALL_SPACE_GROUPS,
    TABLED,
    central_difference,
    equivariance_error,
    groups,
    largest,
    random_field,
    random_tensor,
    seeds,
    small_fields,
    space_group,
    space_groups,
    wallpaper_groups,
)


def coefficients(field):
    """(M, 2, d) cosine and sine coefficients of a single field, from its basis."""
    basis = field.basis
    flat = np.zeros(len(basis.frequencies) * 2 * field.group.dim)
    parameters = (field.parameters_ * field.scale).detach().numpy()
    np.add.at(flat, basis.rows, parameters[basis.columns] * basis.values)
    return flat.reshape(len(basis.frequencies), 2, field.group.dim)


def naive_field(field, point, lib=math):
    """The field at one point, mode by mode."""
    u = [lib.fsum(a * x for a, x in zip(row, point, strict=True)) for row in inverse_rows(field)]
    total = [0.0 if lib is math else lib.mpf(0)] * field.group.dim
    for k, (a, b) in zip(field.basis.frequencies, coefficients(field), strict=True):
        norm = lib.sqrt(2) if k.any() else 1.0
        phase = 2 * lib.pi * lib.fsum(int(n) * x for n, x in zip(k, u, strict=True))
        c, s = norm * lib.cos(phase), norm * lib.sin(phase)
        total = [t + float(x) * c + float(y) * s for t, x, y in zip(total, a, b, strict=True)]
    return total


def inverse_rows(field):
    return field.group.inverse_lattice.tolist()


def brute_force_dimension(group, max_frequency):
    """Trace of the projector: mean over elements of the trace of their action (characters)."""
    box = itertools.product(range(-max_frequency, max_frequency + 1), repeat=group.dim)
    duals = [np.round(group.inverse_lattice @ g.linear @ group.lattice) for g in group.cosets]
    modes = {tuple((np.array(k) @ m).astype(int)) for k in box for m in duals}
    total = 0.0
    for g, m in zip(group.cosets, duals, strict=True):
        shift = group.inverse_lattice @ g.translation
        for k in modes:
            if np.array_equal(np.array(k) @ m, k):
                total += math.cos(2 * math.pi * float(np.dot(k, shift))) * np.trace(g.linear)
    return total / group.order


@pytest.mark.parametrize("max_frequency", [1, 5, 10])
@pytest.mark.parametrize("name", TABLED)
def test_equivariance_holds_to_rounding_for_every_class_and_space(name, max_frequency):
    group = TABLED[name]
    for seed in range(3):
        field = random_field(group, max_frequency, seed)
        assert equivariance_error(field, group, random_tensor(seed, 20, 2)) < 1e-11


@settings(max_examples=7)
@given(space_groups(SMALL_SPACE_GROUPS), seeds)
def test_equivariance_holds_to_rounding_in_space(group, seed):
    field = random_field(group, 2, seed)
    assert equivariance_error(field, group, random_tensor(seed, 6, 3)) < 1e-11


@settings(max_examples=20)
@given(groups, st.integers(0, 3))
def test_the_number_of_parameters_is_the_trace_of_the_projector(group, max_frequency):
    max_frequency = min(max_frequency, 2) if group.dim == 3 else max_frequency
    size = FourierField(group, max_frequency).size
    assert size == pytest.approx(brute_force_dimension(group, max_frequency), abs=1e-8)


@given(st.builds(FourierField, groups, st.integers(0, 2)))
def test_the_basis_is_orthonormal(field):
    basis = field.basis
    dense = np.zeros((len(basis.frequencies) * 2 * field.group.dim, basis.size))
    dense[basis.rows, basis.columns] = basis.values
    np.testing.assert_allclose(dense.T @ dense, np.eye(basis.size), atol=1e-13)


@given(small_fields, seeds)
def test_values_are_those_of_the_sum_over_modes(field, seed):
    points = random_tensor(seed, 2, field.group.dim)
    expected = [naive_field(field, p) for p in points.tolist()]
    np.testing.assert_allclose(field(points).detach().numpy(), expected, atol=1e-11)


@settings(max_examples=7)
@given(st.builds(random_field, groups, st.integers(0, 2), seeds, rms=st.floats(0.1, 10)))
def test_the_norm_of_the_parameters_is_the_root_mean_square_of_the_field(field):
    group = field.group
    # the trapezoidal rule is exact for the squares of these modes
    sides = [4 * int(k) + 2 for k in np.abs(field.basis.frequencies).max(axis=0)]
    axes = [np.arange(n) / n for n in sides]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, group.dim)
    values = field(torch.tensor(grid @ group.lattice.T))
    rms = values.square().sum(dim=-1).mean().sqrt().item()
    assert rms == pytest.approx(field.parameters_.norm().item(), rel=1e-12)


@pytest.mark.parametrize("name", ["IH1", "IH6", "IH21"])
def test_single_precision_is_close_to_double(name):
    field = random_field(TABLED[name], 10, 0)
    points = random_tensor(0, 200, 2)
    single = random_field(TABLED[name], 10, 0, dtype=torch.float32)
    assert single(points.float()).dtype == torch.float32
    # coordinates of size 3 are rounded by 1.2e-7 and the field's slope is about 2 pi 10
    error = single(points.float()).double() - field(points)
    assert largest(error) < 1e-4
    error = single.divergence(points.float()).double() - field.divergence(points)
    assert largest(error) < 1e-4 * 2 * math.pi * 10


@settings(max_examples=7)
@given(wallpaper_groups(), st.floats(0.5, 4), seeds)
def test_smoothness_scales_the_parameter_of_each_frequency(group, smoothness, seed):
    smooth = random_field(group, 3, seed, smoothness=smoothness)
    plain = FourierField(group, 3)
    kappa = torch.tensor(plain.basis.magnitude)
    factor = (1 + kappa**2 * group.cell_volume) ** (-smoothness / 2)
    with torch.no_grad():
        plain.parameters_.copy_(smooth.parameters_ * factor)
    points = random_tensor(seed, 5, 2)
    torch.testing.assert_close(smooth(points), plain(points), rtol=0, atol=1e-12)


@given(wallpaper_groups(), st.floats(0.1, 10))
def test_smoothness_does_not_depend_on_the_unit_of_length(group, unit):
    weights = FourierField(group, 3, smoothness=2.0).scale
    scaled = FourierField(group.conjugate(unit * np.eye(2)), 3, smoothness=2.0).scale
    np.testing.assert_allclose(scaled, weights, rtol=1e-10)


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_the_frequency_set_holds_the_box(name):
    found = {tuple(k) for k in frequency_set(wallpaper_group(name), 3).tolist()}
    for k in itertools.product(range(-3, 4), repeat=2):
        assert k in found or (-k[0], -k[1]) in found


@pytest.mark.parametrize("bad", [-1, 2.5, True])
def test_frequencies_that_are_no_count_are_refused(bad):
    with refused("max_frequency"):
        FourierField(wallpaper_group("p1"), bad)


@pytest.mark.parametrize(("group", "bad"), [("p1", 1000), ("p6m", 500), ("P1", 50)])
def test_frequencies_beyond_memory_are_refused(group, bad):
    made = wallpaper_group(group) if group in WALLPAPER_GROUPS else space_group(group, 0)
    with refused("max_frequency", bad, "2,000,000"):
        FourierField(made, bad)


@pytest.mark.parametrize("shape", [(3,), (5, 3), (2, 1)])
def test_points_of_another_dimension_are_refused(shape):
    with refused("(..., 2)", shape):
        FourierField(wallpaper_group("p1"), 1)(torch.zeros(shape, dtype=torch.float64))


@pytest.mark.parametrize("shape", [(2,), (4, 2), (5, 3, 2)])
def test_points_of_another_batch_are_refused(shape):
    with refused("(3, ..., 2)", shape):
        FourierField(wallpaper_group("p1"), 1, batch=3)(torch.zeros(shape, dtype=torch.float64))


def test_a_field_born_in_single_precision_becomes_exact_in_double():
    group = wallpaper_group("p6m")
    field = random_field(group, 5, 0, dtype=torch.float32).double()
    assert equivariance_error(field, group, random_tensor(0, 10, 2)) < 1e-11


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
