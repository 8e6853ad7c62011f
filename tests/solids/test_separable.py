"""Tiles that come apart: sorted labels, and tiles that are moved out of a stack."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.errors import GroupError, SettingError
from orbiflow.solids import FillSettings, certify_solid, fill, separable
from orbiflow.solids.assembly import greatest_overlap
from orbiflow.solids.bodies import as_body, united
from orbiflow.solids.distance import SignedDistance
from orbiflow.solids.separable import (
    check_separable,
    pieces_with_gap,
    separable_tile,
    sorted_labels,
)
from orbiflow.solids.stacks import stack_of
from orbiflow.symmetry import space_group
from refusals import refused
from solids.known_bodies import ball, creature
from solids.known_solids import group_named


@given(st.integers(1, 4), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_labels_are_sorted_as_well_as_can_be(count: int, length: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(count, 1, 2, length))
    labels = sorted_labels(values)
    assert (np.diff(labels, axis=-1) >= 0).all()
    for line, own in zip(np.moveaxis(values[:, 0], 1, 0), labels[0], strict=True):
        best = max(
            sum(line[k, place] for place, k in enumerate(tried))
            for tried in combinations_with_replacement(range(count), length)
        )
        assert line[own, range(length)].sum() == pytest.approx(best)


def test_a_tile_with_a_head_over_its_legs_comes_apart_once_it_is_sorted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(separable, "FINE", 0.05)
    monkeypatch.setattr(separable, "DIRECTIONS", 16)
    group, body = group_named("P -1"), creature()
    distance = SignedDistance.of_mesh(body, 0.05)

    def depth(points: Array) -> Array:
        return -distance(points)

    tile = separable_tile(5000, depth, body, group)
    assert tile is not None
    assert certify_solid(group, tile).valid
    size = float(np.ptp(tile.points, axis=0).max())
    pieces = pieces_with_gap(group, tile)
    leaving = pieces.leaving_stack(group.linear_parts)
    assert leaving.is_free
    # what lines say is checked by moving the body out of copies that are lower
    center = tile.centroid
    for direction in (
        leaving.direction @ group.linear_parts
    ):  # the second is that of inverted copies
        lower = [
            as_body(pieces.piece.moved(g.linear, g.translation))
            for g in group.elements_near(center, 2.5, source=center)[1:]
            if (g.linear @ center + g.translation - center) @ direction < 1e-9
        ]
        way = greatest_overlap(
            as_body(pieces.piece), united(lower), direction, distance=3 * size, steps=20
        )
        assert way < 1e-4
    assert not pieces.assembly(stack_of(group, tile, 12)).is_interlocked


@settings(max_examples=10)
@given(st.sampled_from(["P 21", "P 21 21 21", "P c", "P 41"]))
def test_other_groups_are_refused(name: str) -> None:
    with refused("P -1", kind=GroupError):
        check_separable(space_group(name))


def test_what_does_not_go_together_is_refused() -> None:
    with refused("separable", "bending", kind=SettingError):
        FillSettings(separable=True, method="flow").check()
    with refused("P 1 21 1", kind=GroupError):
        fill(ball(), FillSettings(separable=True, groups=("P21",)))
