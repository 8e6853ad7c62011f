"""What was seen of a picture covers the outline, whatever the level that parts shape and ground."""

import re

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from shapely.geometry.base import BaseGeometry

from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles import Target, polygons_in

STEPS = 10
"""Levels of the pictures: thresholds are among them, so that many pixels lie on one."""


@st.composite
def pictures(draw: st.DrawFn) -> np.ndarray:
    """Draw a small picture of dark blobs on a light ground in few levels."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    blobs = gaussian_filter(rng.random((30, 36)), draw(st.floats(0.8, 4)))
    low, high = blobs.min(), blobs.max()
    return np.pad(np.round((blobs - low) / (high - low) * STEPS) / STEPS, 2, constant_values=1.0)


def filled(target: Target) -> BaseGeometry:
    assert target.seen is not None
    return shapely.union_all([shapely.Polygon(p.exterior) for p in polygons_in(target.seen)])


@settings(max_examples=40)
@given(pictures(), st.integers(1, STEPS - 1), st.sampled_from([0.0, 0.02, 0.06]))
def test_what_was_seen_covers_the_outline(picture: np.ndarray, threshold, thicken) -> None:
    try:
        target = Target.from_mask(picture, threshold=threshold / STEPS, invert=False)
    except InputFileError:  # specks alone
        assume(False)
        raise
    target = target.thickened(thicken)
    outline = shapely.Polygon(target.outline)
    assert target.seen is not None
    assert target.seen.is_valid
    assert filled(target).buffer(0.5).covers(outline)  # but for what simplifies each
    assert filled(target).intersection(outline).area > 0.98 * outline.area


@settings(max_examples=20)
@given(pictures(), st.integers(1, STEPS - 1), st.sampled_from([0.02, 0.05]))
def test_smoothing_keeps_the_shape_that_was_read(picture: np.ndarray, threshold, share) -> None:
    try:
        target = Target.from_mask(picture, threshold=threshold / STEPS, invert=False)
    except InputFileError:
        assume(False)
        raise
    outline, width = shapely.Polygon(target.outline), share * np.ptp(target.outline, axis=0).max()
    kept = max(polygons_in(outline.buffer(-width / 2)), key=lambda part: part.area, default=None)
    assume(kept is not None and kept.area > 0.5 * outline.area)
    smooth = shapely.Polygon(target.smoothed(share).outline)
    assert smooth.buffer(width / 10).covers(kept)


@settings(max_examples=20)
@given(pictures(), st.integers(1, STEPS - 1), st.sampled_from([0.01, 0.05, 0.15]))
def test_smoothing_counts_the_parts_that_it_left_out(picture: np.ndarray, threshold, share) -> None:
    try:
        target = Target.from_mask(picture, threshold=threshold / STEPS, invert=False)
        smooth = target.smoothed(share)
    except InputFileError:
        assume(False)
        raise
    except OrbiflowError:  # nothing is left
        assume(False)
        raise
    outline = shapely.Polygon(smooth.outline)
    apart = [part for part in polygons_in(filled(target)) if not part.intersects(outline)]
    areas = [part.area for part in apart if part.area >= 1e-3 * outline.area]
    said = [re.findall(r"[\d.]+", note) for note in smooth.notes if " components " in note]
    assert len(said) == bool(areas)
    if said:
        count, percent = map(float, said[0][:2])
        assert count == len(areas) + 1
        assert percent == pytest.approx(100 * outline.area / (outline.area + sum(areas)), abs=0.06)
