"""Local thickness: the largest disc inside that covers a point."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import resampled
from orbiflow.tiles.silhouette import triangulate
from outlines import bar, comb, disc, dumbbell


def thickness(ring: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """At the triangles' middles, with these."""
    mesh = triangulate(resampled(ring, count))
    return mesh.points[mesh.triangles].mean(axis=1), mesh.local_thickness


def test_a_disc_is_as_thick_everywhere() -> None:
    _, found = thickness(disc(200), 120)
    assert found == pytest.approx(np.pi**-0.5, rel=0.01)


@settings(max_examples=6)
@given(st.floats(0.1, 0.5), st.floats(-3, 3))
def test_a_bar_has_half_its_width(width: float, turn: float) -> None:
    ring = bar(1 / width, width)
    middle, found = thickness(ring @ rotation_matrix(turn).T, 240)
    middle = middle @ rotation_matrix(turn)
    inside = (middle[:, 0] > width / 2) & (middle[:, 0] < 1 / width - width / 2)
    assert found[inside] == pytest.approx(width / 2, rel=0.03)
    assert found.max() <= width / 2 + 1e-12
    assert (found > 0).all()


def test_the_teeth_of_a_comb_are_thin_and_its_back_is_not() -> None:
    middle, found = thickness(comb(3, 0.2, 0.4, 1.0, back=0.8), 400)
    teeth = (middle[:, 1] > 0.9) & (middle[:, 1] < 1.65)  # not the corners of the ends
    assert found[teeth].max() <= 0.1 + 1e-12
    assert found[teeth].min() > 0.09
    back = (abs(middle[:, 0] - 0.7) < 0.3) & (middle[:, 1] < 0.6)
    assert found[back] == pytest.approx(0.4, rel=0.1)


def test_a_neck_is_thinner_than_what_it_joins() -> None:
    middle, found = thickness(dumbbell(0.1, 1.0), 600)
    neck = (middle[:, 0] > 1.1) & (middle[:, 0] < 1.9)
    assert found[neck].min() > 0.04
    assert found[neck].max() <= 0.05 + 1e-12
    heart = np.hypot(middle[:, 0] - 0.5, middle[:, 1] - 0.5) < 0.4
    assert found[heart] == pytest.approx(0.5, rel=0.05)
