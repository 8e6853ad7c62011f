"""Candidate tiles: D = A o L o flow."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import CLASSES, IsohedralClass, TileModel, certify
from orbiflow.tiles.flowing.tile_model import extract_tile
from refusals import refused
from strategies import largest, random_points, random_tensor, seeds

kinds = st.sampled_from(list(CLASSES.values()))


def random_model(
    kind: IsohedralClass, seed: int, size: int = 1, *, dtype: torch.dtype = torch.float64, **options
) -> TileModel:
    """Candidates with every parameter away from its start; the flow moves points by about 0.1."""
    rng = np.random.default_rng(seed)
    model = TileModel(
        kind,
        torch.tensor(rng.uniform(-3, 3, size)),
        mirrored=torch.tensor(rng.random(size) < 0.5),
        max_frequency=2,
        dtype=dtype,
        **options,
    )
    spread = {"log_scale": 0.5, "offset": 2.0, "shape": 0.1, "stretch": 0.3}
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            noise = torch.tensor(rng.uniform(-1, 1, parameter.shape))
            if name.startswith("flow."):
                noise *= 0.15 / max(parameter.shape[-1], 1) ** 0.5
            parameter.add_(spread.get(name, 1.0) * noise)
    return model


def same_isometries(a: CrystallographicGroup, b: CrystallographicGroup) -> bool:
    return a.order == b.order and all(b.contains(g) for g in a.cosets)


@settings(max_examples=6)
@given(kinds, seeds, st.integers(1, 2))
def test_inverse_undoes_forward(kind: IsohedralClass, seed: int, segments: int) -> None:
    model = random_model(kind, seed, 2, segments=segments, steps=32)
    points = random_tensor(seed, 2, 9, 2)
    assert largest(model.inverse(model(points)) - points) < 1e-6
    assert largest(model.unplace(model.place(points)) - points) < 1e-13


@settings(max_examples=7)
@given(kinds, seeds)
def test_place_is_a_stretch_then_a_similarity(kind: IsohedralClass, seed: int) -> None:
    model = random_model(kind, seed, 3)
    similarity = model.linear() @ torch.linalg.inv(kind.stretch(model.stretch))
    squared = model.log_scale.mul(2).exp()[:, None, None] * torch.eye(2, dtype=torch.float64)
    assert largest(similarity @ similarity.mT - squared) < 1e-13 * largest(squared)
    negative = torch.linalg.det(similarity) < 0
    assert torch.equal(negative, model.mirror)


@pytest.mark.parametrize("name", CLASSES)
def test_starts_from_the_centred_template_of_area_one(name: str) -> None:
    kind = CLASSES[name]
    mirrored = torch.tensor([False, True, False])
    model = TileModel(kind, torch.tensor([0.0, 1.0, -2.5]), mirrored=mirrored, max_frequency=1)
    corners = model(model.template()).detach()
    assert largest(corners.mean(dim=1)) < 1e-14
    x, y = corners.unbind(dim=-1)
    area = 0.5 * (x * y.roll(-1, 1) - x.roll(-1, 1) * y).sum(dim=1)
    assert largest(area - torch.tensor([1.0, -1.0, 1.0])) < 1e-13


@settings(max_examples=9)
@given(kinds, seeds)
def test_tiles_of_any_parameters_are_certified(kind: IsohedralClass, seed: int) -> None:
    model = random_model(kind, seed)
    tile, fine = extract_tile(model)
    certificate = certify(tile, tolerance=1e-9)
    assert certificate.valid, certificate.reasons
    area = model.log_scale.mul(2).exp().item() * kind.group().cell_volume / kind.group().order
    assert abs(tile.signed_area) == pytest.approx(area, rel=1e-12)
    assert (tile.signed_area < 0) == bool(model.mirror[0])
    linear, offset = model.linear().detach().numpy()[0], model.offset.detach().numpy()[0]
    assert same_isometries(tile.group, kind.group().conjugate(linear, offset))
    # every element moves the diffeomorphism's image as the class's group moves its argument
    points = random_points(seed, 1, 5, 2)
    for g in kind.group().cosets:
        with torch.no_grad():
            left, right = fine(torch.tensor(g(points))).numpy(), fine(torch.tensor(points)).numpy()
        moved = g.inverse().linear @ linear.T  # (A R A^-1) q on rows is q A^-T R^T A^T
        pushed = (right - offset) @ np.linalg.inv(linear.T) @ moved + g.translation @ linear.T
        assert np.abs(left - pushed - offset).max() < 1e-10


@settings(max_examples=7)
@given(kinds, seeds)
def test_take_keeps_the_values(kind: IsohedralClass, seed: int) -> None:
    model = random_model(kind, seed, 4, segments=2, smoothness=1.5, steps=3, method="rk3")
    taken = model.take([2, 0])
    points = random_tensor(seed, 4, 6, 2)
    assert taken.size == 2
    assert torch.equal(taken.mirror, model.mirror[[2, 0]])
    own = dict(model.named_parameters())
    for name, parameter in taken.named_parameters():
        assert torch.equal(parameter, own[name][[2, 0]])
    # products of stacks of another size may round otherwise
    assert largest(taken(points[[2, 0]]) - model(points)[[2, 0]]) < 1e-12
    with torch.no_grad():  # a copy, not a view
        taken.offset.add_(1.0)
    assert largest(taken.offset - model.offset[[2, 0]] - 1.0) < 1e-12


def test_a_stack_has_no_single_group() -> None:
    model = random_model(CLASSES["IH4"], 0, 2)
    with refused("candidate", 2):
        extract_tile(model)
