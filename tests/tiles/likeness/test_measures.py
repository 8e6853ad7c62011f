"""The gradients of what an outline keeps of another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from orbiflow.arrays import Complex
from orbiflow.tiles.likeness import Measures, mark_gradient
from strategies import seeds

COUNT, STEP = 120, 1e-7


def outline(rng: np.random.Generator) -> Complex:
    """A smooth outline without straight sides, whose turning has no kinks."""
    angle = np.linspace(0, 2 * np.pi, COUNT, endpoint=False)
    waves = np.arange(2, 9)[:, None]
    radius = 1 + (rng.normal(0, 0.05, (7, 1)) * np.cos(waves * angle)).sum(axis=0)
    radius = radius + (rng.normal(0, 0.05, (7, 1)) * np.sin(waves * angle)).sum(axis=0)
    return np.maximum(radius, 0.3) * np.exp(1j * angle)


def bent(rest: Complex, rng: np.random.Generator) -> Complex:
    angle = np.linspace(0, 2 * np.pi, COUNT, endpoint=False)
    waves = np.exp(1j * np.arange(-6, 7)[:, None] * angle)
    bends = rng.normal(0, 0.02, (13, 2)) @ np.array([1, 1j])
    return 1.7 * (rest + bends @ waves) + complex(*rng.normal(size=2))


@given(seeds)
def test_gradients_are_the_numerical_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rest = outline(rng)
    measures, z = Measures(rest), bent(rest, rng)
    values, along = measures.gradients(z)
    assert values == pytest.approx(measures.values(z), abs=1e-12)
    way = np.exp(1j * rng.uniform(0, 2 * np.pi, COUNT))
    more, less = (measures.values(z + step * way) for step in (STEP, -STEP))
    change = (along.conj() @ way).real
    size = abs(along).sum(axis=1) + 1e-3  # the largest that the change could be
    assert (abs((more - less) / (2 * STEP) - change) < 2e-3 * size).all()


@given(seeds)
def test_wrinkles_and_the_mark_have_theirs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rest = outline(rng)
    measures, z = Measures(rest), bent(rest, rng)
    way = np.exp(1j * rng.uniform(0, 2 * np.pi, COUNT))
    places = np.arange(COUNT) + rng.uniform(0.1, 0.9, COUNT)  # no point at a vertex, where it kinks
    for found in (lambda z: measures.wrinkles(z, places), lambda z: mark_gradient(measures, z)):
        change = (found(z)[1].conj() @ way).real
        numerical = (found(z + STEP * way)[0] - found(z - STEP * way)[0]) / (2 * STEP)
        assert abs(numerical - change) < 2e-3 * (abs(found(z)[1]).sum() + 1e-3)
    slide, along = rng.uniform(-1, 1, COUNT), measures.wrinkles(z, places)[2]
    more, less = (measures.wrinkles(z, places + step * slide)[0] for step in (STEP, -STEP))
    assert abs((more - less) / (2 * STEP) - along @ slide) < 2e-3 * (abs(along).sum() + 1e-3)


def test_an_outline_at_rest_has_no_wrinkles() -> None:
    rest = outline(np.random.default_rng(1))
    measures, places = Measures(rest), np.arange(COUNT)
    assert measures.wrinkles(rest, places)[0] < 1e-9
    rough = rest + 0.002 * np.random.default_rng(2).normal(size=COUNT)
    assert measures.wrinkles(rough, places)[0] > 1


def test_wrinkles_between_the_points_count() -> None:
    rest = outline(np.random.default_rng(1))
    ring = np.stack([rest, (rest + np.roll(rest, -1)) / 2], axis=1).ravel()
    measures, places = Measures(ring), np.repeat(2.0 * np.arange(COUNT), 2)
    rough = ring * (1 + 0.01 * (np.arange(2 * COUNT) % 2))  # points lie at the other vertices
    assert measures.wrinkles(rough, places)[0] > measures.wrinkles(ring, places)[0] + 1
