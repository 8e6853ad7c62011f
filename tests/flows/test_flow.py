"""The flow of vector fields: map, inverse, log-determinant, symmetry, gradients."""

import copy
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from torch import Tensor, nn

from orbiflow.fields import FourierField
from orbiflow.flows import METHODS, Flow
from orbiflow.flows.flow import MULTITHREADED_COORDINATES
from orbiflow.symmetry import wallpaper_group
from refusals import refused
from strategies import (
    TABLED,
    gentle_field,
    groups,
    largest,
    map_equivariance_error,
    plane_groups,
    random_field,
    random_tensor,
    seeds,
    several,
)

names = st.sampled_from(sorted(METHODS))


@pytest.mark.parametrize("name", ["IH6", "sphere"])
def test_the_flow_agrees_with_an_adaptive_integrator(name):
    field = gentle_field(TABLED[name], 3, 0, slope=4.0)
    points = random_tensor(0, 6, 2)
    bound = field.bound()

    def slope(_, y):
        with torch.no_grad():
            return bound(torch.tensor(y.reshape(-1, 2))).numpy().ravel()

    solution = solve_ivp(
        slope, (0.0, 1.0), points.numpy().ravel(), method="DOP853", rtol=1e-13, atol=1e-13
    )
    with torch.no_grad():
        moved = Flow(field, steps=200, method="rk5")(points)
    np.testing.assert_allclose(moved.numpy().ravel(), solution.y[:, -1], rtol=0, atol=1e-10)


@settings(max_examples=3)
@given(groups, seeds, st.sampled_from([("rk4", 64), ("rk5", 24)]))
def test_the_inverse_undoes_the_flow(group, seed, scheme):
    method, steps = scheme
    flow = Flow(gentle_field(group, 1, seed), steps=steps, method=method)
    points = random_tensor(seed, 5, group.dim)
    with torch.no_grad():
        error = max(
            largest(flow.inverse(flow(points)) - points),
            largest(flow(flow.inverse(points)) - points),
        )
    assert error <= 1e-8


def test_segments_follow_one_another():
    fields = several(wallpaper_group("p3"), 0)
    points = random_tensor(0, 10, 2)
    one_by_one = points
    for field in fields:
        one_by_one = Flow(field, steps=8)(one_by_one)
    assert torch.equal(Flow(fields, steps=8)(points), one_by_one)
    backwards = points
    for field in reversed(fields):
        backwards = Flow(field, steps=8).inverse(backwards)
    assert torch.equal(Flow(fields, steps=8).inverse(points), backwards)


def test_a_negative_duration_is_the_inverse():
    field = gentle_field(wallpaper_group("p2"), 2, 0)
    points = random_tensor(0, 10, 2)
    backwards = Flow(field, steps=10, duration=-1.0)(points)
    assert torch.equal(backwards, Flow(field, steps=10).inverse(points))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("steps", [1, 3])
def test_a_linear_field_gives_the_truncated_exponential(name, steps):
    # up to order 4 with as many stages, a step is the Taylor polynomial of exp(h M)
    matrix = random_tensor(0, 2, 2, size=0.5)
    points = random_tensor(1, 4, 2)
    moved = Flow(lambda p: p @ matrix.mT, steps=steps, method=name, warn=False)(points)
    h = matrix / steps
    order = METHODS[name].order
    step = sum(torch.linalg.matrix_power(h, k) / math.factorial(k) for k in range(order + 1))
    if name == "rk5":  # its sixth stage adds a term of order six
        a = np.zeros((6, 6))
        for i, row in enumerate(METHODS[name].stages):
            a[i + 1, : len(row)] = row
        sixth = float(np.array(METHODS[name].weights) @ np.linalg.matrix_power(a, 5).sum(axis=1))
        step = step + sixth * torch.linalg.matrix_power(h, 6)
    expected = points @ torch.linalg.matrix_power(torch.as_tensor(step), steps).mT
    torch.testing.assert_close(moved, expected, rtol=1e-13, atol=1e-13)


@settings(max_examples=3)
@given(groups, seeds)
def test_the_log_determinant_is_that_of_the_jacobian_of_the_flow(group, seed):
    flow = Flow(gentle_field(group, 1, seed), steps=32, method="rk5")
    points = random_tensor(seed, 3, group.dim)
    stacked = torch.autograd.functional.jacobian(lambda p: flow(p).sum(dim=0), points)
    assert isinstance(stacked, torch.Tensor)
    expected = torch.linalg.slogdet(stacked.movedim(0, 1))
    assert expected.sign.tolist() == [1.0] * 3
    torch.testing.assert_close(
        flow.log_abs_det_jacobian(points).detach(), expected.logabsdet, rtol=0, atol=1e-8
    )


@settings(max_examples=5)
@given(plane_groups, seeds, st.integers(1, 3))
def test_log_determinants_forth_and_back_cancel(group, seed, segments):
    flow = Flow(several(group, seed, segments), steps=24, method="rk5")
    points = random_tensor(seed, 5, 2)
    with torch.no_grad():
        moved, there = flow.forward_and_log_det(points)
        back, home = flow.inverse_and_log_det(moved)
    torch.testing.assert_close(back, points, rtol=0, atol=1e-8)
    torch.testing.assert_close(there, -home, rtol=0, atol=1e-8)


@given(plane_groups, seeds, names)
def test_points_move_alike_with_and_without_the_log_determinant(group, seed, method):
    flow = Flow(several(group, seed), steps=2, method=method, warn=False)
    points = random_tensor(seed, 5, 2)
    with torch.no_grad():
        moved, log_det = flow.forward_and_log_det(points)
        assert log_det.shape == (5,)
        torch.testing.assert_close(moved, flow(points), rtol=0, atol=1e-13)
        moved, _ = flow.inverse_and_log_det(points)
        torch.testing.assert_close(moved, flow.inverse(points), rtol=0, atol=1e-13)


def test_a_module_list_is_taken_as_its_members():
    fields = several(wallpaper_group("p2"), 0)
    points = random_tensor(0, 4, 2)
    assert torch.equal(Flow(nn.ModuleList(fields))(points), Flow(fields)(points))


def test_a_batch_of_fields_carries_a_batch_of_points():
    batch = random_field(wallpaper_group("p3"), 2, 0, batch=3, rms=0.2)
    points = random_tensor(0, 3, 5, 2)
    moved, log_det = Flow(batch, steps=4).forward_and_log_det(points)
    for s in range(3):
        single = FourierField(batch.group, 2)
        with torch.no_grad():
            single.parameters_.copy_(batch.parameters_[s])
        alone, alone_log_det = Flow(single, steps=4).forward_and_log_det(points[s])
        torch.testing.assert_close(moved[s], alone, rtol=0, atol=1e-13)
        torch.testing.assert_close(log_det[s], alone_log_det, rtol=0, atol=1e-13)


def test_single_precision_is_close_to_double():
    flow = Flow(gentle_field(wallpaper_group("p6"), 5, 0), steps=8)
    single = copy.deepcopy(flow).float()
    points = random_tensor(0, 50, 2)
    moved, log_det = single.forward_and_log_det(points.float())
    assert moved.dtype == log_det.dtype == torch.float32
    assert largest(moved - flow(points)) < 2e-5
    assert largest(log_det - flow.log_abs_det_jacobian(points)) < 2e-4


@pytest.mark.parametrize("shape", [(2,), (0, 2), (3, 4, 2)])
def test_shapes_of_points_are_kept(shape):
    flow = Flow(gentle_field(wallpaper_group("p4"), 2, 0), steps=2)
    points = torch.zeros(shape, dtype=torch.float64)
    moved, log_det = flow.forward_and_log_det(points)
    assert moved.shape == shape
    assert log_det.shape == shape[:-1]


def _in_place(points: Tensor) -> Tensor:
    return points.mul_(-1.0)


class _InPlace(torch.nn.Module):
    def forward(self, points: Tensor) -> Tensor:
        points[..., 0] += 0.3
        return points.sin_()


class _WithDivergence(_InPlace):
    def divergence(self, points: Tensor) -> Tensor:
        points[..., 0] += 0.3
        return points.cos_().sum(dim=-1)


@pytest.mark.parametrize("field", [_in_place, _InPlace(), _WithDivergence()])
def test_fields_may_write_into_their_points(field: Any) -> None:
    """The caller's tensor is left as it is, and the result is that of a field that does not write."""
    points = torch.rand(7, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    before = points.clone()
    plain = (
        (lambda p: -p) if field is _in_place else (lambda p: (p + p.new_tensor([0.3, 0.0])).sin())
    )
    written, pure = Flow(field, warn=False), Flow(plain, warn=False)
    assert torch.equal(written(points), pure(points))
    assert torch.equal(written.inverse(points), pure.inverse(points))
    for found, expected in zip(
        written.forward_and_log_det(points), pure.forward_and_log_det(points), strict=True
    ):
        assert torch.allclose(found, expected, atol=1e-12)
    assert torch.equal(points, before)


def test_what_is_no_flow_is_refused() -> None:
    wrong: tuple[Any, ...] = (math.nan, math.inf, -math.inf, "1", True)
    for value in wrong:
        with refused("duration"):
            Flow(torch.sin, duration=value)
    counts: tuple[Any, ...] = (*wrong, 0, -3, 2.5)
    for value in counts:
        with refused("steps"):
            Flow(torch.sin, steps=value)
        with refused("steps"):
            Flow(torch.sin).with_steps(value)
    with refused("heun"):
        Flow(torch.sin).with_steps(4, method="heun")
    with refused("field"):
        Flow([])
    for name in ("steps", "method", "duration"):  # others may share them
        with pytest.raises(AttributeError):
            setattr(Flow(torch.sin), name, 1)


def test_a_view_integrates_in_its_own_steps():
    fields = several(wallpaper_group("p4"), 0)
    flow, points = Flow(fields, steps=4), random_tensor(0, 5, 2)
    view = flow.with_steps(9, method="midpoint")
    assert (view.steps, view.method, flow.steps, flow.method) == (9, "midpoint", 4, "rk4")
    assert flow.with_steps(9).method == "rk4"
    assert torch.equal(view(points), Flow(fields, steps=9, method="midpoint")(points))
    assert torch.equal(flow(points), Flow(fields, steps=4)(points))


def test_a_view_shares_its_parameters():
    flow = Flow(several(wallpaper_group("p4"), 0), steps=4)
    view = flow.with_steps(8)
    assert [id(p) for p in view.parameters()] == [id(p) for p in flow.parameters()]
    assert list(view.state_dict()) == list(flow.state_dict())
    with torch.no_grad():
        for parameter in view.parameters():
            parameter.zero_()
    points = random_tensor(0, 5, 2)
    assert torch.equal(flow(points), points)


@pytest.fixture
def seen() -> Iterator[list[int]]:
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    yield []
    assert torch.get_num_threads() == 3
    torch.set_num_threads(before)


@pytest.mark.parametrize(("count", "threads"), [(5, 1), (MULTITHREADED_COORDINATES, 3)])
@pytest.mark.parametrize("apply", ["forward", "inverse", "forward_and_log_det"])
def test_how_many_threads_carry(seen: list[int], count: int, threads: int, apply: str) -> None:
    def field(points: Tensor) -> Tensor:
        seen.append(torch.get_num_threads())
        return 0 * points

    flow = Flow(field, steps=1, method="euler", warn=False)
    getattr(flow, apply)(torch.zeros(count, 1))
    assert set(seen) == {threads}


@settings(max_examples=10)
@given(groups, seeds, st.sampled_from(sorted(METHODS)), st.integers(1, 4))
def test_equivariance_holds_to_rounding_for_any_group(group, seed, method, steps):
    flow = Flow(random_field(group, 1, seed), method=method, steps=steps, duration=0.1, warn=False)
    assert map_equivariance_error(flow, group, random_tensor(seed, 8, group.dim)) < 1e-11


@pytest.mark.parametrize("quantity", ["moved", "log_det"])
@pytest.mark.parametrize("segments", [1, 2])
def test_gradients_of_parameters_agree_with_finite_differences(quantity, segments):
    fields = several(wallpaper_group("pg"), 0, segments)
    flow = Flow(fields, steps=3)
    points = random_tensor(0, 6, 2)

    def loss():
        moved, log_det = flow.forward_and_log_det(points)
        return (moved.sin() if quantity == "moved" else log_det.square()).sum()

    parameters = fields[0].parameters_
    (gradient,) = torch.autograd.grad(loss(), parameters)
    step = 1e-5
    for i in range(0, parameters.numel(), 5):
        with torch.no_grad():
            parameters[i] += step
            above = loss().item()
            parameters[i] -= 2 * step
            below = loss().item()
            parameters[i] += step
        slope = (above - below) / (2 * step)
        assert gradient[i].item() == pytest.approx(slope, rel=1e-6, abs=1e-8)


def test_second_derivatives_pass_through_several_steps():
    # inside an integrator the points depend on the parameters from the second stage on
    field = gentle_field(wallpaper_group("p4"), 2, 0)
    flow = Flow(field, steps=3, method="midpoint")
    points = random_tensor(0, 4, 2)

    def loss(parameters):
        with torch.no_grad():
            field.parameters_.copy_(parameters)
        return flow(points).sin().sum()

    start = field.parameters_.detach().clone()
    (plain,) = torch.autograd.grad(loss(start), field.parameters_)
    (gradient,) = torch.autograd.grad(loss(start), field.parameters_, create_graph=True)
    torch.testing.assert_close(gradient.detach(), plain, rtol=1e-12, atol=1e-12)
    direction = random_tensor(1, field.size)
    (curvature,) = torch.autograd.grad(gradient @ direction, field.parameters_)
    step = 1e-5
    above, below = (
        torch.autograd.grad(loss(start + sign * step * direction), field.parameters_)[0]
        for sign in (1, -1)
    )
    torch.testing.assert_close(curvature, (above - below) / (2 * step), rtol=1e-5, atol=1e-7)
