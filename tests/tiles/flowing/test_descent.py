"""The descent: symmetric, injective, uphill; settings; the whole fit."""

import dataclasses

import numpy as np
import pytest
import shapely
import torch

from orbiflow.tiles import (
    CLASSES,
    OverlapSearch,
    SoftTarget,
    Target,
    TileMap,
    as_map,
    as_model,
    certify,
    escherize_class,
    fit_descent,
    iou,
    isohedral_class,
    trainable,
)
from orbiflow.tiles.flowing.descent import MAX_STEP_STEEPNESS, Descent
from orbiflow.tiles.flowing.starts import template_starts
from orbiflow.tiles.flowing.tile_model import extract_tile
from orbiflow.tiles.likeness import boundary_iou
from orbiflow.tiles.search import Goal
from outlines import searched
from refusals import refused

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
TARGET = Target.from_polygon(BOOT)
QUICK = OverlapSearch.for_effort(
    "fast", max_frequency=4, candidates=4, stages=((8, 2), (8, 1)), projected=100, measured=20
)


@pytest.fixture(scope="module")
def soft() -> SoftTarget:
    return SoftTarget(TARGET)


def descent(name: str, settings: OverlapSearch = QUICK) -> Descent:
    kind = isohedral_class(name)
    starts = template_starts(kind, turns=3, stretch=0.2, vertices=settings.boundary)
    return Descent(kind, starts, settings)


@pytest.mark.parametrize("name", CLASSES)
def test_the_record_is_the_flow(name: str, soft: SoftTarget) -> None:
    # the recorded fields, followed by the flow's own integrator, end where the boundary did
    state = descent(name)
    start = state.points.clone()
    for _ in range(10):
        state.step(soft)
    model = state.model.with_fields(state.record)
    assert model.segments == 10
    with torch.no_grad():
        moved = model.flow(start)
    assert (moved - state.points).abs().max() < 1e-4
    assert torch.equal(model.prototile()[0], start)


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21"])
def test_steps_are_injective(name: str, soft: SoftTarget) -> None:
    # a displacement whose Jacobian is smaller than one cannot fold
    state = descent(name)
    torch.manual_seed(0)
    for _ in range(6):
        state.step(soft)
        last = state.record[-1]
        state.field.parameters_.data.copy_(last)
        points = torch.rand(state.model.size, 60, 2) * 3
        columns = []
        for direction in torch.eye(2):
            h = 1e-3
            ahead, behind = (state.field(points + s * h * direction) for s in (1, -1))
            columns.append((ahead - behind) / (2 * h))
        jacobian = torch.stack(columns, dim=-1)
        norms = torch.linalg.matrix_norm(jacobian, ord=2)
        assert norms.max() <= MAX_STEP_STEEPNESS * 1.01
        assert norms.max() * (1 + MAX_STEP_STEEPNESS / 2) < 1


def test_descent_climbs(soft: SoftTarget) -> None:
    state = descent("IH4", dataclasses.replace(QUICK, stages=((60, 1),)))
    goal = shapely.Polygon(TARGET.normal)
    before = boundary_iou(goal, state.placed())
    for _ in range(60):
        state.step(soft)
    after = boundary_iou(goal, state.placed())
    assert after.max() > before.max() + 0.05
    assert np.median(after) > np.median(before)


def test_the_lattice_can_be_held(soft: SoftTarget) -> None:
    for lattice in (False, True):
        state = descent("IH1", dataclasses.replace(QUICK, lattice=lattice))
        before = state.model.stretch.detach().clone()
        state.step(soft)
        assert torch.equal(state.model.stretch.detach(), before) != lattice


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21"])
def test_a_fit_certifies_and_survives_storage(name: str) -> None:
    found = fit_descent(TARGET, isohedral_class(name), QUICK)
    tile, fine = extract_tile(trainable(found.candidates).take([0]))
    certificate = certify(tile)
    assert certificate.valid
    assert certificate.edge_mismatch < 1e-12
    assert iou(tile.polygon, TARGET.normal) > 0.75
    assert found.starts >= 1
    saved = as_map(fine)
    again = extract_tile(as_model(saved))[0]
    assert np.allclose(again.polygon, tile.polygon, atol=1e-12)


def test_templates_may_be_the_only_starts() -> None:
    few = dataclasses.replace(QUICK, starts="template")
    found = fit_descent(TARGET, isohedral_class("IH4"), few)
    assert certify(extract_tile(trainable(found.candidates).take([0]))[0]).valid


def test_broken_prototiles_are_refused() -> None:
    saved = as_map(
        trainable(fit_descent(TARGET, isohedral_class("IH4"), QUICK).candidates).take([0])
    )
    outline, corners = saved.arrays["prototile.outline"], saved.arrays["prototile.corners"]
    broken = {
        "(N, 2)": {"prototile.outline": outline[:, :1]},
        "finite": {"prototile.outline": np.full_like(outline, np.nan)},
        "increasing": {"prototile.corners": corners[::-1].copy()},
        "indices": {"prototile.corners": corners + len(outline)},
    }
    for word, arrays in broken.items():
        with refused(word):
            as_model(TileMap(saved.settings, {**saved.arrays, **arrays}))


def test_the_same_seed_gives_the_same_tile() -> None:
    one, two = (escherize_class(TARGET, "IH5", QUICK) for _ in range(2))
    other = escherize_class(TARGET, "IH5", dataclasses.replace(QUICK, seed=1))
    polygons = [getattr(o, "tile").polygon for o in (one, two, other)]  # noqa: B009
    assert np.array_equal(polygons[0], polygons[1])
    assert polygons[0].shape != polygons[2].shape or not np.array_equal(polygons[0], polygons[2])


def test_several_tiles_of_a_class_are_not_twins() -> None:
    results, failures = searched(TARGET, ["IH4", "IH6"], QUICK, per_class=3)
    assert not failures
    assert [r.score for r in results] == sorted((r.score for r in results), reverse=True)
    for name in ("IH4", "IH6"):
        own = [r.tile.polygon for r in results if r.name == name]
        assert 1 <= len(own) <= 3
        for i, first in enumerate(own):
            assert all(iou(first, second) <= 0.97 for second in own[i + 1 :])


def test_a_preview_is_certified() -> None:
    for names in (["IH1"], ["IH28", "IH21"]):
        tile = QUICK.preview(Goal(TARGET), names)
        assert tile is not None
        assert tile.name in names
        assert tile.certificate.valid


def test_soft_target_agrees_with_the_polygon(soft: SoftTarget) -> None:
    rng = np.random.default_rng(0)
    region = shapely.Polygon(TARGET.normal)
    points = rng.uniform(-1, 1, (400, 2))
    inside = shapely.contains_xy(region, points[:, 0], points[:, 1])
    far = shapely.distance(shapely.points(points), region.exterior) > 0.01
    occupancy = soft.occupancy(torch.tensor(points, dtype=torch.float32), 0.01).numpy()
    assert ((occupancy > 0.5) == inside)[far].all()
    assert soft.weight(torch.zeros(3, 2)).tolist() == [1.0, 1.0, 1.0]
    rings = torch.tensor(np.stack([TARGET.normal, TARGET.normal * 0.9 + 0.05]), dtype=torch.float32)
    exact = [iou(ring, TARGET.normal) for ring in rings.double().numpy()]
    assert np.allclose(soft.weighted_iou(rings).numpy(), exact, atol=5e-3)


def test_efforts_are_checked() -> None:
    with refused("effort", "heroic"):
        OverlapSearch.for_effort("heroic")
    with refused("magic"):
        OverlapSearch.for_effort("fast", magic=1)
