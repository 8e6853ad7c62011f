"""Reduce points to a fundamental domain: the Dirichlet domain of a site."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import is_tensor
from orbiflow.arrays import Array
from orbiflow.errors import GroupError
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.isometry import (
    Isometry,
    Points,
    cast_like,
)


class DirichletDomain:
    """The points nearer to `site` than to any other point of its orbit: a fundamental domain.

    For the four identification spaces and the site (1/2, 1/2) it is the paper's canonical square,
    and `project` the canonical projection (paper, section 5.2; design point 12).

    Args:
        group: any crystallographic group.
        site: (d,) point moved by every element but the identity.

    Raises:
        GroupError: if an element fixes the site.
    """

    def __init__(self, group: CrystallographicGroup, site: ArrayLike) -> None:
        self.group = group
        self.site = np.asarray(site, dtype=np.float64)
        if self.site.shape != (group.dim,) or not np.isfinite(self.site).all():
            raise GroupError(f"the site must be {group.dim} finite numbers, got {site!r}")
        size = group.cell_volume ** (1 / group.dim)
        for g in group.elements_near(self.site, 1e-6 * size)[1:]:
            raise GroupError(f"the site {self.site.tolist()} is fixed by {g!r}: move it off")

    @cached_property
    def _candidates(self) -> list[Isometry]:
        # every point of the cell lies within `diameter` of some image of the site
        center = self.group.lattice.sum(axis=1) / 2
        diameter = float(np.linalg.norm(self.group.lattice, axis=0).sum())
        return self.group.elements_near(center, 1.5 * diameter, source=self.site)

    @cached_property
    def _sites(self) -> Array:
        return np.stack([g(self.site) for g in self._candidates])

    def locate(self, points: Points) -> tuple[Points, Array]:
        """Points wrapped to the lattice cell, and the index of the nearest image of the site."""
        wrapped = self.group.wrap(points)
        own: Any = wrapped
        plain: Array = own.detach().cpu().numpy() if is_tensor(own) else own
        flat = np.asarray(plain, dtype=np.float64).reshape(-1, self.group.dim)
        nearest = np.empty(len(flat), dtype=np.int64)
        for start in range(0, len(flat), 65536):  # bounds the distance table
            block = flat[start : start + 65536]
            squared = (self._sites**2).sum(axis=1) - 2.0 * block @ self._sites.T
            nearest[start : start + 65536] = squared.argmin(axis=1)
        return wrapped, nearest.reshape(plain.shape[:-1])

    def project(self, points: Points) -> Points:
        """Representatives in the domain of the orbits of points, shape (..., d).

        Differentiable almost everywhere for torch tensors.
        """
        wrapped, nearest = self.locate(points)
        linear = np.stack([g.linear for g in self._candidates])[nearest]
        shift = np.stack([g.translation for g in self._candidates])[nearest]
        offset = wrapped - cast_like(shift, wrapped)
        # inverse of an isometry: transpose of the linear part
        return (offset[..., None, :] @ cast_like(linear, wrapped))[..., 0, :]
