"""Candidate tiles, D = A o L o flow, and their polygons."""

import numpy as np
import pytest
import scipy.spatial
import shapely
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.errors import CertificationError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import CLASSES, IsohedralClass, TileModel, certify
from orbiflow.tiles.flowing import tile_model
from orbiflow.tiles.flowing.tile_model import converge, extract_tile
from orbiflow.tiles.search.candidates import SAMPLE_COUNTS, TOLERANCES
from refusals import refused
from strategies import divided_start, error_estimate, largest, random_points, random_tensor, seeds

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


@settings(max_examples=4)
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


def bent(name: str, rms: float = 0.15, seed: int = 0) -> TileModel:
    """A turned candidate whose fields have the given root mean square."""
    model = TileModel(CLASSES[name], torch.tensor([0.7]), max_frequency=2, smoothness=0.0)
    rng = np.random.default_rng(seed)
    with torch.no_grad():
        for field in model.flow.parameters():
            values = torch.tensor(rng.normal(size=field.shape))
            field.copy_(rms * values / values.norm())
    return model


def crossed() -> TileModel:
    """A candidate whose template crosses itself."""
    model = TileModel(CLASSES["IH21"], torch.tensor([0.7]), max_frequency=1)
    with torch.no_grad():
        model.shape.add_(2.0)
    return model


def test_converge_doubles_until_accurate() -> None:
    model = bent("IH4")
    points = divided_start(model, 4)
    model.flow = model.flow.with_steps(2)
    _, error = converge(model, points, tolerance=1e-7)
    assert error <= 1e-7
    chosen = model.flow.steps
    with torch.no_grad():
        moved = model.flow(points)
        exact = model.flow.with_steps(16 * chosen)(points)
    assert (moved - exact).norm(dim=-1).max().item() <= 1e-7
    # no finer than need be: an eighth of the steps is too coarse
    assert error_estimate(model.flow.with_steps(max(1, chosen // 8)), points) > 1e-7


def test_converge_gives_up_on_a_steep_field() -> None:
    model = bent("IH1", rms=3000.0)
    model.flow = model.flow.with_steps(512, method="euler")
    with refused("1024 steps", "max-frequency", kind=CertificationError):
        converge(model, divided_start(model, 1))


def test_converge_refuses_a_field_that_is_not_finite() -> None:
    model = bent("IH1")
    with torch.no_grad():
        next(model.flow.parameters()).fill_(float("nan"))
    steps = model.flow.steps
    with refused("learning rate", kind=CertificationError):
        converge(model, divided_start(model, 1))
    assert model.flow.steps == steps
    for force in (False, True):
        with refused("finite", kind=CertificationError):
            extract_tile(model, force=force)


@pytest.mark.parametrize("name", CLASSES)
def test_polygon_follows_the_curve(name: str) -> None:
    model = bent(name)
    settings_before = (model.flow.steps, model.flow.method)
    tile, fine = extract_tile(model)
    assert (model.flow.steps, model.flow.method) == settings_before
    kind = CLASSES[name]
    with torch.no_grad():
        pieces = 2 * -(-SAMPLE_COUNTS[0] // (2 * len(kind.template())))
        curve = fine(divided_start(fine, pieces))[0].numpy()
    assert tile.isohedral_class == name
    assert len(tile.corners) == len(kind.template())
    assert np.allclose(tile.polygon[list(tile.corners)], curve[::pieces], atol=1e-12)
    nearest = np.asarray(scipy.spatial.KDTree(curve).query(tile.polygon)[0])
    assert nearest.max() < 1e-12
    ring = shapely.Polygon(tile.polygon).exterior
    # the model has area 1, so tolerances are lengths; a partner edge is no worse
    assert shapely.distance(shapely.points(curve), ring).max() <= TOLERANCES[0] * 1.001
    assert len(tile.polygon) < len(curve) / 2
    assert certify(tile).edge_matching == "segments"


def test_a_crossing_boundary_is_refused_unless_forced() -> None:
    with refused("IH21", kind=CertificationError):
        extract_tile(crossed())
    tile, _ = extract_tile(crossed(), force=True)
    assert len(tile.polygon) == SAMPLE_COUNTS[-1]
    certificate = certify(tile)
    assert not certificate.valid
    assert "not simple: self-intersection" in certificate.reasons[0]


def test_force_takes_an_inaccurate_flow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tile_model, "MAX_STEPS", 8)
    with refused("16 steps", kind=CertificationError):
        extract_tile(bent("IH3"))
    # edges match at any number of steps (design point 5)
    assert certify(extract_tile(bent("IH3"), force=True)[0]).edge_mismatch < 1e-12
