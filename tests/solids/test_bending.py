"""Groups with a free lattice, poses, and bodies that bend until their copies meet."""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orbiflow.errors import GroupError, SettingError
from orbiflow.solids import FillSettings, GroupFamily
from orbiflow.solids.bending import QUICK_STAGES, REACH, BentBody, bent, contacts
from orbiflow.solids.body import Body
from orbiflow.solids.distance import SignedDistance, points_inside
from orbiflow.solids.families import USUAL_GROUPS
from orbiflow.solids.likeness import measured, rigid_motion
from orbiflow.solids.poses import FINENESS, Cover, Pose, best_poses, orbits_of_bins, polished
from orbiflow.solids.search import coverage
from orbiflow.solids.settings import EmphasisSphere
from orbiflow.symmetry import space_group
from refusals import refused
from solids.known_solids import ball, creature

NAMES = (*USUAL_GROUPS, "C 2", "P 3", "R 3", "P 61", "I 41", "P 21 3", "P -4")
SEEDS = st.integers(0, 2**32 - 1)


@cache
def body() -> Body:
    mesh = creature()
    bounds = np.stack([mesh.points.min(axis=0), mesh.points.max(axis=0)])
    return Body.of(SignedDistance.of_mesh(mesh, 0.03), bounds, 0.12)


@cache
def bent_creature(name: str) -> BentBody:
    family = GroupFamily.named(name)
    points = points_inside(creature(), 0.08)
    pose = best_poses(family, points, np.random.default_rng(1), tried=60, climbed=2, steps=30)[0]
    return bent(BentBody.of(body(), pose), QUICK_STAGES)


@settings(max_examples=25)
@given(name=st.sampled_from(NAMES), seed=SEEDS)
@example(name="P 21 3", seed=0)  # whose lattice is not free
def test_all_groups_of_a_family_have_its_operations(name: str, seed: int) -> None:
    family = GroupFamily.named(name)
    values = np.random.default_rng(seed).normal(0, 0.3, family.freedom)
    group = family.group(values)
    assert group.cell_volume == pytest.approx(group.order)
    squares = group.linear_parts @ np.swapaxes(group.linear_parts, 1, 2)
    np.testing.assert_allclose(squares, np.broadcast_to(np.eye(3), squares.shape), atol=1e-9)
    np.testing.assert_array_equal(group.integral_parts, family.turns)
    np.testing.assert_allclose(group.lattice, family.lattice(values), atol=1e-12)


def test_groups_with_mirrors_are_refused_and_glides_are_no_mirrors() -> None:
    for name in ("P m", "P m m m", "C m", "F m -3 m", "P 4/m", "P b c m"):
        with refused(name, kind=GroupError):
            GroupFamily.named(name)
    for name in ("P c", "C c", "P b c a", "I b a 2", "P 4/n", "R 3 c"):
        assert GroupFamily.named(name).order == space_group(name, origin=1).order


@settings(max_examples=20)
@given(seed=SEEDS)
def test_distances_to_a_ball(seed: int) -> None:
    mesh = ball()
    radius = (3 / (4 * np.pi)) ** (1 / 3)
    points = np.random.default_rng(seed).uniform(-1, 1, (200, 3))
    found = SignedDistance.of_mesh(mesh, 0.05)(points)
    np.testing.assert_allclose(found, np.linalg.norm(points, axis=1) - radius, atol=0.02)
    assert len(points_inside(creature(), 0.04)) * 0.04**3 == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("name", [*USUAL_GROUPS, "C 2", "P 21 3", "P -4"])  # which map bins to bins
def test_bins_of_an_orbit_are_images(name: str) -> None:
    family, side = GroupFamily.named(name), 12
    orbits = orbits_of_bins(family, side)
    places = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    turn, shift = family.turns[-1], family.shifts[-1]
    image = np.floor((((places + 0.5) / side) @ turn.T + shift) * side + 1e-6).astype(int) % side
    np.testing.assert_array_equal(orbits[tuple(image.T)], orbits[tuple(places.T)])
    assert orbits.max() + 1 >= side**3 / family.order


def test_a_climb_covers_more() -> None:
    family, points = GroupFamily.named("P 21"), points_inside(creature(), 0.06)
    few = best_poses(family, points, np.random.default_rng(0), tried=50, climbed=1, steps=0)[0]
    more = best_poses(family, points, np.random.default_rng(0), tried=50, climbed=1, steps=150)[0]
    assert more.cover > few.cover
    assert Cover(family, points).of(more.stretches, more.turn, more.place) == more.cover
    many = points_inside(creature(), 0.03)
    again = polished([few, more], many, np.random.default_rng(0), 60)
    fine = Cover(family, many, FINENESS)
    assert [fine.of(own.stretches, own.turn, own.place) for own in again] == [
        own.cover for own in again
    ]
    starts = [fine.of(own.stretches, own.turn, own.place) for own in (few, more)]
    assert min(own.cover for own in again) > min(starts)
    assert again[0].cover > max(starts)
    assert again[0].cover >= again[1].cover


def test_a_body_at_rest_stays() -> None:
    own = body()
    np.testing.assert_allclose(
        own.pulled(1.0).solved(own.rest, own.rest[: own.size]), own.rest, atol=1e-9
    )
    assert own.strain(own.rest) < 1e-9
    assert own.surface(own.rest).is_closed
    assert own.surface(own.rest).volume == pytest.approx(1, abs=0.02)


@settings(max_examples=10)
@given(seed=SEEDS)
def test_a_body_moves_rigidly(seed: int) -> None:
    own, random = body(), np.random.default_rng(seed)
    turn, shift = np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(size=3)
    turn *= np.linalg.det(turn)
    nodes = own.rest @ turn.T + shift
    assert own.strain(nodes) < 1e-9
    points = creature().points[::7]
    np.testing.assert_allclose(own.carried(nodes, points), points @ turn.T + shift, atol=1e-9)
    found = rigid_motion(own.rest, nodes)
    np.testing.assert_allclose(found[0], turn, atol=1e-9)
    np.testing.assert_allclose(found[1], shift, atol=1e-9)


@pytest.mark.parametrize("name", ["P -1", "P 21 21 21"])
def test_copies_of_a_bent_body_meet(name: str) -> None:
    found = bent_creature(name)
    before = BentBody.of(body(), Pose(found.family, found.stretches, *_placed(found)))
    assert sum(coverage(found)) < 0.6 * sum(coverage(before))
    assert abs(contacts(found).gaps).mean() < abs(contacts(before).gaps).mean()
    assert 0 < found.strain < 0.3
    assert found.surface.is_closed


@settings(max_examples=10)
@given(seed=SEEDS)
def test_all_that_may_touch_a_body_is_asked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = body().rest @ np.diag([1.2, 0.8, 1.0])
    own = BentBody(body(), GroupFamily.named("P 1"), np.zeros(6), nodes)
    low, high = own.surface.bounds
    points = rng.uniform(low - REACH, high + REACH, (4000, 3))
    asked = own.may_touch(points)
    assert not (~asked & (own.distance(points) < REACH)).any()
    assert 0.2 < asked.mean() < 0.98


def _placed(found: BentBody) -> tuple[np.ndarray, np.ndarray]:
    turn, shift = rigid_motion(found.body.rest, found.nodes)
    return turn, np.linalg.solve(found.lattice, shift)


def test_what_is_emphasised_bends_less() -> None:
    mesh = creature()
    head = mesh.points[mesh.points[:, 0].argmax()]
    bounds = np.stack([mesh.points.min(axis=0), mesh.points.max(axis=0)])
    weight = EmphasisSphere(tuple(head), 0.3, 50.0).weights
    assert weight(head[None])[0] > 40
    heavy = Body.of(SignedDistance.of_mesh(mesh, 0.03), bounds, 0.12, weight)
    assert heavy.importance[: heavy.size].max() > 20 > body().importance.max()


def test_a_body_is_like_itself() -> None:
    mesh = creature()
    own = measured(mesh, mesh, mesh, np.ones(len(mesh.points)), 0.0)
    assert own.overlap == own.shadows == own.score == 1
    away = measured(mesh.moved(np.eye(3), (0.2, 0, 0)), mesh, mesh, np.ones(len(mesh.points)), 0.0)
    assert away.score < 0.9


def test_spheres_are_read() -> None:
    spheres = FillSettings(emphasis=("1,2,3,4", "0 0 0 1 7")).emphasised
    assert spheres == (EmphasisSphere((1, 2, 3), 4), EmphasisSphere((0, 0, 0), 1, 7))
    for text in ("1,2,3", "1,2,3,x", "1,2,3,0", "1,2,3,1,1000", "nan,0,0,1"):
        with refused("emphasis", kind=SettingError):
            FillSettings(emphasis=(text,))
