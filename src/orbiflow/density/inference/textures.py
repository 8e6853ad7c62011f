"""Figures of textures, which are densities of orientations: pole densities, index, volume fractions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density, Estimate
from orbiflow.density.spaces import RotationSpace
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_instance, as_number
from orbiflow.typed_torch import linalg

FIRST_NODES, MOST_NODES = 64, 4096
"""Points of a circle of rotations over which a density without a closed form is averaged."""

FIBRE_ERROR = 1e-6
"""Difference of two averages, in multiples of the uniform density, that is small enough."""

BLOCK = 2**15
"""Rotations at which a density is evaluated at a time."""

DRAWS = 2**16
"""Draws from which shares are estimated, always the same ones."""


@torch.no_grad()
def pole_density(
    density: Density, crystal: ArrayLike, specimen: ArrayLike, *, axial: bool = True
) -> tuple[Array, float]:
    """Return how often directions of the crystal lie along directions of the specimen: (N,).

    It is the mean over all orientations that take one to the other, in multiples of the random
    density, which has 1. As a function of the specimen's direction it is a pole figure, as one of the
    crystal's an inverse pole figure. Kernels and mixtures have it in closed form.

    Args:
        density: A density on a space of rotations.
        crystal: Directions in the crystal's coordinates, (3,) or (N, 3), of any length.
        specimen: Directions in the specimen's, (3,) or (N, 3).
        axial: Whether a direction and its opposite are one, as for the normals of lattice planes.

    Returns:
        The pole densities, and what their error is below: the largest difference of two numerical
        integrals where the density has no closed form, 0 where all is exact.

    Raises:
        OrbiflowError: If the density is none of rotations, or a direction is 0.

    Reference: Bunge, Texture Analysis in Materials Science (1982), section 4.2.

    >>> from orbiflow.density import UniformDensity
    >>> pole_density(UniformDensity(RotationSpace()), [0, 0, 1], [[0, 1, 0]])
    (array([1.]), 0.0)
    """
    space = rotations_only(density)
    here, there = map(np.array, np.broadcast_arrays(_directions(crystal), _directions(specimen)))
    # images have the same pole density
    there = _canonical(there, space.specimen_rotations, axial=axial)
    here = _canonical(here, space.crystal_rotations, axial=axial)
    pairs, place = np.unique(np.hstack([here, there]), axis=0, return_inverse=True)
    first, second = torch.tensor(pairs[:, :3]), torch.tensor(pairs[:, 3:])
    # where either direction and its opposite are images, both ways are one
    is_even = any(
        np.allclose(_canonical(own, group, axial=False), _canonical(-own, group, axial=False))
        for own, group in (
            (pairs[:, :3], space.crystal_rotations),
            (pairs[:, 3:], space.specimen_rotations),
        )
    )
    ways = (first, -first) if axial and not is_even else (first,)
    total, error = torch.zeros(len(pairs), dtype=torch.float64), 0.0
    for weight, part in density.parts():
        for way in ways:
            found = part.fibre_means(way, second)
            if found is None:
                found, off = _by_quadrature(part, way.numpy(), second.numpy())
                error += weight * off / len(ways)
            total += weight / len(ways) * found
    return total.numpy()[place.reshape(-1)], error


def _canonical(vectors: Array, group: Rotation, *, axial: bool) -> Array:
    """Return the greatest images (N, 3), coordinate by coordinate, to twelve digits."""
    images = np.stack([turn.apply(vectors) for turn in group]).round(12) + 0.0
    if axial:
        images = np.concatenate([images, 0.0 - images])
    best: Array = images[0]
    image: Array
    for image in images[1:]:
        first = np.argmax(image != best, axis=1)[:, None]
        greater = np.take_along_axis(image, first, 1) > np.take_along_axis(best, first, 1)
        best = np.where(greater, image, best)
    return best


def _by_quadrature(density: Density, crystal: Array, specimen: Array) -> tuple[Tensor, float]:
    """Return means (N,) over circles of rotations, and the largest change by half of the nodes."""
    # any rotation that takes one direction to the other, after a turn about the first
    aligned = np.stack([_onto(*pair).as_quat() for pair in zip(crystal, specimen, strict=True)])
    last, nodes = None, FIRST_NODES
    while True:
        angles: Array = 2 * math.pi * np.arange(nodes) / nodes
        parts: list[Tensor] = []
        for some in np.array_split(np.arange(len(aligned)), -(-len(aligned) * nodes // BLOCK)):
            turns = angles[None, :, None] * crystal[some, None, :]
            every = Rotation.from_quat(np.repeat(aligned[some], nodes, axis=0))
            every = every * Rotation.from_rotvec(turns.reshape(-1, 3))
            values = density.log_prob(torch.tensor(every.as_quat()), measure="uniform").exp()
            parts.append(values.reshape(len(some), nodes).mean(dim=1))
        found = torch.cat(parts)
        off = math.inf if last is None else float((found - last).abs().max())
        if off < FIBRE_ERROR or nodes >= MOST_NODES:
            return found, off
        last, nodes = found, 2 * nodes


def _onto(start: Array, end: Array) -> Rotation:
    """Return a rotation that takes a unit vector to another."""
    axis, cosine = np.cross(start, end), float(start @ end)
    if np.linalg.norm(axis) < 1e-12 and cosine < 0:  # half a turn about anything across
        axis = np.cross(start, np.eye(3)[np.abs(start).argmin()])
        return Rotation.from_rotvec(math.pi * axis / np.linalg.norm(axis))
    return Rotation.from_quat([*axis, 1 + cosine])


def _directions(vectors: ArrayLike) -> Array:
    """Return unit vectors (N, 3)."""
    table = np.atleast_2d(np.asarray(vectors, dtype=np.float64))
    length = np.linalg.norm(table, axis=1, keepdims=True)
    if table.shape[1] != 3 or not np.isfinite(table).all() or (length == 0).any():
        raise OrbiflowError("directions are vectors of three finite numbers, not all 0")
    return table / length


def rotations_only(density: Density) -> RotationSpace:
    """Return the space of a density, which must be one of rotations."""
    space = as_instance(density, Density, "density").space
    if not isinstance(space, RotationSpace):
        raise OrbiflowError(
            f"textures are densities of rotations or orientations, not of the {space.name}"
        )
    return space


@torch.no_grad()
def texture_index(density: Density) -> Estimate:
    """Return the mean of the squared density in multiples of the random one, which has 1.

    It is exact, with error 0, for kernels and mixtures; otherwise, and where there are too many kernels
    for all their pairs, it is the mean density of draws with its standard error.

    Reference: Bunge, Texture Analysis in Materials Science (1982), section 4.7.
    """
    rotations_only(density)
    parts, total = list(density.parts()), 0.0
    for weight, one in parts:
        for other_weight, other in parts:
            product = one.mean_product(other)
            if product is None:
                return _estimated_index(density)
            total += weight * other_weight * product
    return Estimate(total, 0.0)


def _estimated_index(density: Density) -> Estimate:
    draws = density.sample((DRAWS,), torch.Generator().manual_seed(0))
    values = density.log_prob(draws, measure="uniform").exp()
    return Estimate(float(values.mean()), float(values.std()) / math.sqrt(DRAWS))


def misorientations(space: RotationSpace, points: Tensor, reference: Tensor) -> Tensor:
    """Return the angles (N,) in radians between orientations (N, 4) and one (4,).

    Of all rotations that take one of the images to the other, they are the smallest.
    """
    images, points = space.features(reference[None].double())[:, 0], points.double()
    near = images[(images @ points.mT).argmax(dim=0)]
    # half the chord is the sine of a quarter of the angle: an arc cosine would lose small ones
    chord = linalg.vector_norm(points - near, dim=1)
    return 4 * torch.asin((chord / 2).clamp_max(1))


@torch.no_grad()
def fractions_near(
    density: Density, orientations: Sequence[Tensor], angle: float
) -> list[Estimate]:
    """Return the shares of a texture within an angle of orientations, with their standard errors.

    Args:
        density: A density on a space of rotations.
        orientations: For each share unit quaternions (V, 4), the scalar last: variants of one
            orientation, near any of which one is near.
        angle: The largest misorientation, in radians.
    """
    space = rotations_only(density)
    reach = as_number(angle, "angle", above=0, most=math.pi)
    draws = density.sample((DRAWS,), torch.Generator().manual_seed(0)) if orientations else None
    found: list[Estimate] = []
    for variants in orientations:
        assert draws is not None
        apart = torch.stack([misorientations(space, draws, one) for one in variants])
        share = float((apart.amin(dim=0) <= reach).double().mean())
        error = math.sqrt(max(share * (1 - share), 1 / DRAWS) / DRAWS)
        found.append(Estimate(share, error))
    return found
