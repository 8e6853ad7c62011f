"""Klein-bottle coordinates of 3 x 3 image patches.

The surface is that of Carlsson, Ishkhanov, de Silva and Zomorodian, *On the local behavior of spaces
of natural images*, Int. J. Computer Vision 76, 2008: patches that are polynomials of degree two in one
direction. With x to the right and y up from the middle pixel, both -1, 0 or 1, and t = x cos theta +
y sin theta,

    K(theta, phi) = cos(phi) t / |t| + sin(phi) (t^2 - mean) / |t^2 - mean|,

where |.| is the contrast norm of Lee, Pedersen and Mumford (*The nonlinear statistics of high-contrast
patches in natural images*, IJCV 54, 2003): the root of the sum, over the 12 pairs of pixels that share
a side, of the squared differences. The two terms are orthogonal, so K has contrast norm 1, and
K(theta + pi, pi - phi) = K(theta, phi): the identification of `KleinBottle`, in the same coordinates.
phi = 0 is an edge that grows bright in direction theta, phi = pi/2 a dark line across it, phi = -pi/2
a bright one.

Distances are Euclidean in the eight DCT coordinates of Lee et al., in which the contrast norm is the
length: patches lie on the unit sphere in R^8.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.spaces.flat import whole_turn
from orbiflow.density.spaces.space import checked_table, row_count
from orbiflow.errors import OrbiflowError

FLAT = 1e-12
"""Contrast, relative to the largest pixel value, below which a patch has no direction."""

_GRID = 96
_STARTS = 3
_NEWTON = 12
_BLOCK = 8192
"""Patches computed at a time, which bounds the memory."""


def _dct_basis() -> Array:
    """(9, 8): the columns e_1, ..., e_8 of Lee et al., pixels row by row from the top left."""
    flat, slope, bend = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]], dtype=np.float64)
    pairs = (  # down the rows, along the columns, squared length of their product in contrast norm
        (flat, slope, 6),
        (slope, flat, 6),
        (flat, bend, 54),
        (bend, flat, 54),
        (slope, slope, 8),
        (bend, slope, 48),
        (slope, bend, 48),
        (bend, bend, 216),
    )
    return np.stack([np.outer(down, along).ravel() / n**0.5 for down, along, n in pairs], axis=1)


DCT_BASIS = _dct_basis()
"""(9, 8): patches of contrast norm 1 and mean 0, orthogonal in that norm."""


class KleinCoordinates(NamedTuple):
    """Places of patches on the Klein bottle, and their distances from it.

    - `angles`: Angles (N, 2): theta in [0, 1/2) turns, phi in [-1/4, 3/4) turns.
    - `distances`: Distances (N,) of unit vectors in DCT coordinates, from 0 on the surface to sqrt(2).
    """

    angles: Array
    distances: Array


def to_klein(patches: ArrayLike, *, unit: str = "radians") -> KleinCoordinates:
    """Return the points of the Klein bottle nearest to patches, whatever their mean and contrast.

    Args:
        patches: Pixel values (N, 9), row by row from the top left, or DCT coordinates (N, 8).
        unit: Unit of the angles: "radians", "degrees" or "turns".

    Raises:
        OrbiflowError: If the shape is another one, a value is not finite, or a patch has no contrast.

    >>> to_klein([[0, 1, 2, 0, 1, 2, 0, 1, 2]], unit="degrees").angles.round(9).tolist()
    [[0.0, 0.0]]
    """
    turn = whole_turn(unit)
    coordinates = _unit_coordinates(patches)
    parts = [
        _nearest(coordinates[k : k + _BLOCK]) for k in range(0, max(1, len(coordinates)), _BLOCK)
    ]
    angles, distances = (np.concatenate(part) for part in zip(*parts, strict=True))
    return KleinCoordinates(angles * (turn / (2 * math.pi)), distances)


def klein_patch(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Return K(theta, phi) (..., 9), pixels row by row, of mean 0 and contrast norm 1.

    >>> klein_patch(0.0, -np.pi / 2).reshape(3, 3).round(3).tolist()[0]
    [-0.136, 0.272, -0.136]
    """
    theta, phi = np.broadcast_arrays(np.asarray(theta, float), np.asarray(phi, float))
    edge, line = _edge(theta), _line(theta)
    return (np.cos(phi)[..., None] * edge + np.sin(phi)[..., None] * line) @ DCT_BASIS[:, :5].T


def pixels_to_dct(patches: ArrayLike) -> Array:
    """Return DCT coordinates (N, 8) of patches (N, 9), whose length is the contrast norm."""
    # the basis is orthogonal in the plain product, too
    dual = DCT_BASIS / (DCT_BASIS**2).sum(axis=0)
    return checked_table(patches, (9,), "patches of 3 x 3 pixels") @ dual


def _unit_coordinates(patches: ArrayLike) -> Array:
    """Return DCT coordinates (N, 8) of length 1."""
    table = checked_table(patches, (8, 9), "patches: 9 pixel values or 8 DCT coordinates")
    scale = abs(table).max(axis=1)
    table = table / np.where(scale > 0, scale, 1.0)[:, None]  # so that no square overflows
    found = pixels_to_dct(table) if table.shape[1] == 9 else table
    length = np.linalg.norm(found, axis=1)
    flat = np.flatnonzero(length <= FLAT)
    if len(flat):
        raise OrbiflowError(
            f"row {flat[0] + 1}: a patch without contrast has no place on the Klein bottle"
            f"{row_count(len(flat))}: remove {'it' if len(flat) == 1 else 'them'} first"
        )
    return found / length[:, None]


def _edge(theta: Array) -> Array:
    """Return t / |t| in five DCT coordinates (..., 5): e_1 grows bright to the left, e_2 up."""
    none = np.zeros_like(theta)
    return np.stack([-np.cos(theta), np.sin(theta), none, none, none], axis=-1)


def _line(theta: Array) -> Array:
    """Return (t^2 - mean) / |t^2 - mean| in the first five DCT coordinates (..., 5)."""
    c, s, none = np.cos(theta), np.sin(theta), np.zeros_like(theta)
    square = np.stack([none, none, 6**0.5 * c * c, 6**0.5 * s * s, -(32**0.5) * c * s], axis=-1)
    return square / np.sqrt(6 + 5 * np.sin(2 * theta) ** 2)[..., None]


def _nearest(units: Array) -> tuple[Array, Array]:
    """Return angles (N, 2) in radians and distances (N,) of unit vectors (N, 8).

    For a given theta the best phi is the angle of the two products with edge and line, whose squares
    add up to f(theta), the squared cosine to the surface, of period pi. Its highest places on a grid
    are sharpened by Newton's method and compared: the best may not be next to the best of the grid.
    """
    step = math.pi / _GRID
    grid = step * np.arange(_GRID)
    values = (units[:, :5] @ _edge(grid).T) ** 2 + (units[:, :5] @ _line(grid).T) ** 2
    peaks = (values >= np.roll(values, 1, axis=1)) & (values >= np.roll(values, -1, axis=1))
    order = np.argsort(np.where(peaks, values, -1.0), axis=1)[:, : -_STARTS - 1 : -1]
    start = grid[order]
    theta = start.copy()
    for _ in range(_NEWTON):
        _, slope, bend = _squared_cosine(units[:, None], theta)
        move = np.where(bend < 0, -slope / np.where(bend < 0, bend, 1.0), np.sign(slope) * step / 8)
        theta = np.clip(theta + move, start - step, start + step)
    best = _squared_cosine(units[:, None], theta)[0].argmax(axis=1)
    theta = np.mod(theta[np.arange(len(units)), best], math.pi)
    theta = np.where(theta >= math.pi, 0.0, theta)  # the remainder of a tiny negative number
    edge, line = _edge(theta), _line(theta)
    first, second = ((units[:, :5] * part).sum(axis=1) for part in (edge, line))
    phi: Array = np.arctan2(second, first)
    phi = np.where(phi < -math.pi / 2, phi + 2 * math.pi, phi)
    foot = np.zeros_like(units)
    foot[:, :5] = np.cos(phi)[:, None] * edge + np.sin(phi)[:, None] * line
    return np.stack([theta, phi], axis=1), np.linalg.norm(units - foot, axis=1)


def _squared_cosine(units: Array, theta: Array) -> tuple[Array, Array, Array]:
    """Return f and two derivatives, each (..., S), of unit vectors (..., 1, 8) at theta (..., S)."""
    x, y, xx, yy, xy = (units[..., k] for k in range(5))
    c, s = np.cos(theta), np.sin(theta)
    edge, edge_1 = s * y - c * x, c * y + s * x
    # the line's product is h / sqrt(w), in multiples of 2 theta
    c2, s2 = np.cos(2 * theta), np.sin(2 * theta)
    mean, even, odd = 6**0.5 * (xx + yy) / 2, 6**0.5 * (xx - yy) / 2, -(8**0.5) * xy
    h, h_1, h_2 = (
        mean + even * c2 + odd * s2,
        2 * (odd * c2 - even * s2),
        -4 * (even * c2 + odd * s2),
    )
    w, w_1, w_2 = 6 + 5 * s2**2, 20 * s2 * c2, 40 * (c2**2 - s2**2)
    value = edge**2 + h**2 / w
    slope = 2 * edge * edge_1 + 2 * h * h_1 / w - h**2 * w_1 / w**2
    bend = 2 * (edge_1**2 - edge**2) + 2 * (h_1**2 + h * h_2) / w
    bend += -4 * h * h_1 * w_1 / w**2 - h**2 * w_2 / w**2 + 2 * h**2 * w_1**2 / w**3
    return value, slope, bend
