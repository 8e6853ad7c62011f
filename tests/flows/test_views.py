"""Views of a flow with other steps: same parameters, and nobody else notices."""

from __future__ import annotations

import pytest
import torch

from orbiflow.flows import Flow
from orbiflow.symmetry import wallpaper_group
from refusals import refused
from strategies import random_tensor, several


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


@pytest.mark.parametrize("name", ["steps", "method", "duration"])
def test_a_flow_cannot_be_changed_under_others(name):
    flow = Flow(torch.sin, steps=4)
    with pytest.raises(AttributeError):
        setattr(flow, name, getattr(flow, name))


def test_views_are_checked_like_flows():
    flow = Flow(torch.sin)
    with refused("steps", 0):
        flow.with_steps(0)
    with refused("heun"):
        flow.with_steps(4, method="heun")
