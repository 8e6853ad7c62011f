"""What is built or used under inference mode stays out of later training."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import nn

from orbiflow.fields import FourierField, SplineField, divergence, jacobian, symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from strategies import neural_field, random_tensor

KINDS: dict[str, Callable[[CrystallographicGroup], nn.Module]] = {
    "fourier": lambda group: FourierField(group, 3),
    "spline": lambda group: SplineField(group, 3),
    "network": lambda group: neural_field(group, hidden=(4,)),
    "symmetrized": lambda group: symmetrize(nn.Linear(2, 2).double(), group),
}


OURS = ("fourier", "spline", "network")
"""Kinds whose parameters we make ourselves."""


@pytest.mark.parametrize("kind", OURS)
def test_a_field_built_in_inference_mode_leaves_training_alone(kind: str) -> None:
    group, points = wallpaper_group("p4"), random_tensor(0, 5, 2)
    with torch.inference_mode():
        first = KINDS[kind](group)
        Flow(first, steps=2).forward_and_log_det(points)
        jacobian(first, points)
        divergence(lambda p: first(p), points)
    field = KINDS[kind](group)
    moved, log_det = Flow(field, steps=2).forward_and_log_det(points)
    (moved.sum() + log_det.sum()).backward()
    assert all(p.grad is not None for p in field.parameters())


@pytest.mark.parametrize("kind", OURS)
def test_a_field_built_in_inference_mode_can_be_trained(kind: str) -> None:
    with torch.inference_mode():
        field = KINDS[kind](wallpaper_group("p4"))
    field(random_tensor(0, 5, 2)).sum().backward()
    assert all(p.grad is not None for p in field.parameters())
