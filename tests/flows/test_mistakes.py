"""What cannot be carried is refused in words."""

import numpy as np
import pytest
import torch
from hypothesis import given
from torch import nn

from orbiflow.errors import GroupError
from orbiflow.fields import FourierField, PeriodicFeatures, SplineField, jacobian, symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import IDENTIFICATION_SPACES, identification_group, wallpaper_group
from refusals import refused
from strategies import groups, neural_field, random_tensor

P4 = wallpaper_group("p4")
THREE = random_tensor(0, 4, 3)
PLANAR = {
    "fourier": FourierField(P4, 2), "spline": SplineField(P4, 2),
    "network": neural_field(P4, hidden=(4,)), "symmetrized": symmetrize(torch.tanh, P4),
}  # fmt: skip


@pytest.mark.parametrize("kind", PLANAR)
def test_three_columns_into_a_planar_field(kind):
    with refused("(..., 2)", "(4, 3)"):
        Flow(PLANAR[kind], steps=1)(THREE)
    for apply in (P4.images, P4.wrap, P4.cosets[1], P4.cosets[1].push):
        with refused("(..., 2)", "(4, 3)", kind=GroupError):
            apply(THREE)
        with refused("(..., 2)", "(4, 3)", kind=GroupError):
            apply(THREE.numpy())


@pytest.mark.parametrize("kind", ["fourier", "spline", "network"])
def test_a_float32_field_at_float64_points(kind):
    make = {
        "fourier": lambda: FourierField(P4, 2, dtype=torch.float32),
        "spline": lambda: SplineField(P4, 2, dtype=torch.float32),
        "network": lambda: neural_field(P4, hidden=(4,), dtype=torch.float32),
    }
    flow = Flow(make[kind](), steps=1)
    points = random_tensor(0, 4, 2)
    for apply in (flow, flow.inverse, flow.forward_and_log_det):
        with refused("float32", "points"):
            apply(points)
    assert flow(points.float()).dtype == torch.float32
    assert flow.double()(points).dtype == torch.float64


def test_points_and_fields_that_are_none():
    for points, about in (
        (np.zeros((3, 2)), "ndarray"),
        (torch.zeros(3, 2, dtype=torch.int64), "torch.int64"),
        (torch.tensor(1.0), "()"),
    ):
        with refused(about):
            Flow(torch.sin)(points)
    with refused("p6m"):
        Flow(["p6m"])  # type: ignore[list-item]
    with refused("(4, 3)", "(4, 1)"):
        Flow(lambda p: p[..., :1])(THREE)
    with refused("mat1", kind=RuntimeError):  # the user's own
        Flow(nn.Linear(2, 2).double())(THREE)


@pytest.mark.parametrize(
    "make",
    [
        lambda group: FourierField(group, 3), lambda group: SplineField(group, 3),
        lambda group: symmetrize(torch.tanh, group), lambda group: PeriodicFeatures(group),
        lambda group: neural_field(group),
    ],
    ids=["fourier", "spline", "symmetrize", "features", "network"],
)  # fmt: skip
def test_a_groups_name_in_place_of_a_group(make):
    with refused("CrystallographicGroup", "p6m", kind=GroupError):
        make("p6m")
    with refused("None", kind=GroupError):
        make(None)


@given(groups)
def test_omega_zero_gives_the_constant_fields(group):
    field = FourierField(group, 0)
    assert field.size == round(np.trace(group.linear_parts.mean(axis=0)))
    check_constant(field)


@pytest.mark.parametrize("name", IDENTIFICATION_SPACES)
def test_omega_zero_of_splines(name):
    check_constant(SplineField(identification_group(name), 0))


def check_constant(field: FourierField | SplineField) -> None:
    d = field.group.dim
    with torch.no_grad():
        field.parameters_.normal_()
    flow, points = Flow(field, steps=2), random_tensor(0, 5, d)
    moved, log_det = flow.forward_and_log_det(points)
    (moved.square().sum() + log_det.sum()).backward()
    assert field.parameters_.grad is not None
    shift = (moved - points).detach()
    torch.testing.assert_close(shift, shift[:1].expand(5, d), rtol=0, atol=1e-12)
    torch.testing.assert_close(flow.inverse(moved), points, rtol=0, atol=1e-12)
    assert log_det.abs().max() < 1e-12
    assert field.divergence(points).abs().max() < 1e-12
    assert jacobian(field, points).abs().max() < 1e-12
    assert float(field.lipschitz_bound()) < 1e-12
    assert field.adjoint(points, points).shape == (field.size,)
    again = type(field)(field.group, 0)
    again.load_state_dict(field.state_dict())
    assert torch.equal(again(points), field(points))
