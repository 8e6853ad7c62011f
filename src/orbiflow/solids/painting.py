"""What is painted on a mesh: the part of its surface whose colour differs from most of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import SettingError
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.soup import Soup

PLACES = 40_000
"""Places on the surface at which paint is looked at."""

DIFFERENT = 0.25
"""How far a colour is from the most common one, in some channel of 0 to 1, if it is paint."""

STEPS = 8
"""Steps of a channel, within which colours count as one where the most common one is looked for."""

AROUND = 100
"""Places, those next to a point, whose share of paint is the point's: paint fades over their width."""

MOST_PAINTED = 0.5
"""Share of the surface above which it is in doubt what is painted."""


@dataclass(frozen=True, eq=False)
class Painting:
    """Where a surface is painted.

    - `places`: Places (n, 3) evenly on the surface, in the coordinates of its file.
    - `painted`: (n,) whether the colour there is clearly another than the most common one.
    """

    places: Array
    painted: Array

    @classmethod
    def of(cls, soup: Soup, mesh: Mesh) -> Painting | None:
        """Return what is painted on a mesh that was made of a file's triangles; None without colours.

        Where triangles were joined, cut or left out, the colour is that of the nearest that was there.
        """
        if soup.colours is None:
            return None
        places, _, _ = spread(mesh.points, mesh.faces, PLACES)
        sources, faces, shares = spread(soup.points, soup.faces, 4 * PLACES)
        colours = np.einsum("nk,nkc->nc", shares, soup.colours[soup.faces[faces]])
        colours = colours[np.asarray(cKDTree(sources).query(places)[1])]
        coloured = np.isfinite(colours).all(axis=1)
        if not coloured.any():
            return None
        bins = np.floor(STEPS * np.clip(colours[coloured], 0, 1 - 1e-6)) @ (1, STEPS, STEPS**2)
        _, which, counts = np.unique(bins, return_inverse=True, return_counts=True)
        usual = np.median(colours[coloured][which == counts.argmax()], axis=0)
        away = np.abs(colours - usual).max(axis=1)
        return cls(places, np.where(coloured, away > DIFFERENT, False))

    @cached_property
    def share(self) -> float:
        """The share of the surface that is painted."""
        return float(self.painted.mean())

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.places)

    def weights(self, weight: float, points: Array) -> Array:
        """Return how much points (n, 3) matter (n,): `weight` where all the surface around is painted.

        Without paint it is 1, and near the edge of paint between them.
        """
        near = np.asarray(self._tree.query(points, AROUND)[1])
        return 1 + (weight - 1) * self.painted[near].mean(axis=1)


def checked_painting(painting: Painting | None) -> Painting:
    """Return what is painted on a mesh.

    Raises `SettingError` if nothing is, or so much that what is meant is in doubt.
    """
    if painting is None:
        raise SettingError(
            "{emphasis} 'painted' needs a mesh with colours at its vertices, and this one has none: "
            "paint what matters, as in Blender's Vertex Paint, and save a PLY, or give x,y,z,radius"
        )
    if painting.share == 0:
        raise SettingError(
            "{emphasis} 'painted' needs a mesh of which a part is painted, and this one has one "
            "colour: paint what matters in a colour that is clearly another"
        )
    if painting.share > MOST_PAINTED:
        raise SettingError(
            f"{{emphasis}} 'painted': {painting.share:.0%} of the surface differ from its most common "
            "colour, so what matters is in doubt; paint less than half of a mesh of one colour"
        )
    return painting


def spread(points: Array, faces: Integers, count: int) -> tuple[Array, Integers, Array]:
    """Return places (n, 3) evenly on triangles, of which face (n,), and its corners' shares (n, 3)."""
    corners = points[faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    ends = np.cumsum(areas)
    number = np.arange(count)
    face = np.minimum(np.searchsorted(ends, (number + 0.5) / count * ends[-1]), len(faces) - 1)
    u, v = np.random.default_rng(0).uniform(size=(2, count))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    shares = np.stack([1 - u - v, u, v], axis=1)
    return np.einsum("nk,nkc->nc", shares, corners[face]), face, shares
