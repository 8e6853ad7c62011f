"""Klein-bottle coordinates of image patches."""

import math
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import KleinBottle, to_klein
from orbiflow.density.spaces.patches import DCT_BASIS, klein_patch, pixels_to_dct
from orbiflow.errors import OrbiflowError
from refusals import refused

NATURAL = Path(__file__).parents[3] / "shared/data/density/klein/nk15c30Dct.mat"
angles = st.floats(-20.0, 20.0)
seeds = st.integers(0, 2**32 - 1)


def contrast(patches: np.ndarray) -> np.ndarray:
    """Root of the summed squares of the differences of pixels that share a side, as defined."""
    squares = patches.reshape(-1, 3, 3)
    along, down = np.diff(squares, axis=2), np.diff(squares, axis=1)
    return np.sqrt((along**2).sum(axis=(1, 2)) + (down**2).sum(axis=(1, 2)))


def test_the_basis_is_orthonormal_in_contrast() -> None:
    total = contrast((DCT_BASIS[:, :, None] + DCT_BASIS[:, None, :]).reshape(9, 64).T) ** 2
    np.testing.assert_allclose(total.reshape(8, 8), 2 + 2 * np.eye(8), atol=1e-12)
    np.testing.assert_allclose(DCT_BASIS.sum(axis=0), 0, atol=1e-12)


@given(theta=angles, phi=angles)
def test_there_and_back(theta: float, phi: float) -> None:
    patch = klein_patch(theta, phi)[None]
    found, distances = to_klein(patch)
    space = KleinBottle()
    apart = space.distance(space.to_chart(found), space.to_chart([[theta, phi]]))
    assert float(apart) < 1e-9
    assert distances[0] < 1e-9
    assert 0 <= found[0, 0] < math.pi
    assert -math.pi / 2 <= found[0, 1] < 3 * math.pi / 2
    np.testing.assert_allclose(space.from_chart(space.to_chart(found)), found, atol=1e-9)


@given(theta=angles, phi=angles)
def test_the_identification(theta: float, phi: float) -> None:
    patch = klein_patch(theta, phi)
    np.testing.assert_allclose(klein_patch(theta + math.pi, math.pi - phi), patch, atol=1e-12)
    np.testing.assert_allclose(contrast(patch[None]), 1, atol=1e-12)
    assert abs(patch.mean()) < 1e-12


@given(theta=angles, phi=angles)
def test_patches_are_the_polynomials_of_the_definition(theta: float, phi: float) -> None:
    x, y = np.array([-1, 0, 1]), np.array([[1], [0], [-1]])
    t = (x * math.cos(theta) + y * math.sin(theta)).reshape(1, 9)
    square = t**2 - (t**2).mean()
    expected = math.cos(phi) * t / contrast(t) + math.sin(phi) * square / contrast(square)
    np.testing.assert_allclose(klein_patch(theta, phi), expected[0], atol=1e-12)


@given(seed=seeds)
def test_nothing_on_the_surface_is_nearer(seed: int) -> None:
    patches = np.random.default_rng(seed).normal(size=(20, 9))
    found, distances = to_klein(patches)
    units = pixels_to_dct(patches) / contrast(patches)[:, None]
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 120), np.linspace(-1.6, 4.8, 240))
    surface = pixels_to_dct(klein_patch(theta.ravel(), phi.ravel()))
    cosine = (units @ surface.T).max(axis=1)
    brute = np.sqrt(2 - 2 * cosine)
    assert (distances <= brute + 1e-12).all()
    assert (brute - distances < 0.01).all()
    foot = pixels_to_dct(klein_patch(*found.T))
    np.testing.assert_allclose(np.linalg.norm(units - foot, axis=1), distances, atol=1e-12)


@given(seed=seeds, scale=st.floats(-100, 100).map(lambda p: 10.0**p), offset=st.floats(-1e3, 1e3))
def test_brightness_contrast_and_basis_do_not_matter(seed: int, scale, offset) -> None:
    patches = np.random.default_rng(seed).normal(size=(5, 9))
    expected = to_klein(patches)
    for same in (scale * patches, patches + offset, pixels_to_dct(patches)):
        found = to_klein(same)
        np.testing.assert_allclose(found.distances, expected.distances, atol=1e-9)
        np.testing.assert_allclose(
            klein_patch(*found.angles.T), klein_patch(*expected.angles.T), atol=1e-6
        )
    back = pixels_to_dct(patches) @ DCT_BASIS.T
    np.testing.assert_allclose(back, patches - patches.mean(axis=1, keepdims=True), atol=1e-12)


EDGES = {
    "bright right": ([0, 1, 2] * 3, (0.0, 0.0)),
    "bright up": ([2, 2, 2, 1, 1, 1, 0, 0, 0], (90.0, 0.0)),
    "bright left": ([2, 1, 0] * 3, (0.0, 180.0)),
    "bright upper right": ([1, 2, 3, 0, 1, 2, -1, 0, 1], (45.0, 0.0)),
    "dark line upright": ([1, 0, 1] * 3, (0.0, 90.0)),
    "bright line level": ([0, 0, 0, 1, 1, 1, 0, 0, 0], (90.0, -90.0)),
}


@pytest.mark.parametrize("case", EDGES)
def test_edges_and_lines(case: str) -> None:
    patch, expected = EDGES[case]
    found, distances = to_klein([patch], unit="degrees")
    space = KleinBottle(unit="degrees")
    assert float(space.distance(space.to_chart(found), space.to_chart([expected]))) < 1e-9
    assert distances[0] < 1e-9


def test_far_patches_and_none() -> None:
    saddle = [0, 0, 0, 0, 0, 0, 0, 1]  # orthogonal to all edges and lines
    found, distances = to_klein([saddle])
    assert np.isfinite(found).all()
    assert distances[0] == pytest.approx(math.sqrt(2))
    assert to_klein(np.zeros((0, 9))).angles.shape == (0, 2)


MISTAKES = {
    "flat": ([[0, 1, 2] * 3, [7.0] * 9], "row 2: a patch without contrast"),
    "nearly flat": ([[1e6 + 1e-12 * (k % 3) for k in range(9)]], "row 1"),
    "black": ([[0.0] * 8], "row 1"),
    "not a number": ([[0, 1, 2] * 3, [0, 1, np.nan] * 3], "row 2 has a missing"),
    "wide": ([[0.0] * 10], "(N, 8) or (N, 9)"),
    "squares": (np.zeros((2, 3, 3)), "shape (2, 3, 3)"),
    "words": ([["a"] * 9], "expected numbers"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes(case: str) -> None:
    patches, message = MISTAKES[case]
    with pytest.raises(OrbiflowError) as error:
        to_klein(patches)
    assert message in str(error.value)


def test_mistakes_of_units_and_angles() -> None:
    with refused("unit"):
        to_klein([[0, 1, 2] * 3], unit="gons")
    with refused("DCT"):
        to_klein([[1.0] * 7])


@pytest.mark.skipif(not NATURAL.exists(), reason=f"natural image patches expected in {NATURAL}")
def test_natural_patches_lie_near_the_surface() -> None:
    coordinates = scipy.io.loadmat(NATURAL)["nk15c30Dct"]
    found, distances = to_klein(coordinates)
    assert np.median(distances) < 0.25
    assert distances.max() < 0.7
    assert np.median(to_klein(np.random.default_rng(0).normal(size=(2000, 8))).distances) > 0.7
    # the diagonal term has the right sign: with the other, patches lie farther off
    flipped = to_klein(coordinates * [1, 1, 1, 1, -1, 1, 1, 1]).distances
    assert np.median(distances) < np.median(flipped) - 0.03
    # most are edges, upright or level
    assert (abs(np.cos(found[:, 1])) > 0.7).mean() > 0.7
    assert (abs(np.sin(2 * found[:, 0])) < 0.5).mean() > 0.4
