"""The proof that a solid's copies under a space group fill space, without gaps or overlaps."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.solids.bodies import as_body, common_volume, moved_body
from orbiflow.solids.crossings import crossing_pairs
from orbiflow.solids.mesh import Mesh
from orbiflow.symmetry import CrystallographicGroup, Isometry

VOLUME_TOLERANCE = 1e-9
"""How much the volume may differ from the cell's share, relative to it."""

PAIR_TOLERANCE = 1e-9
"""How much a face may miss its partner's copy, in edges of a cube as large as the solid."""

BOOLEAN_TOLERANCE = 1e-6
"""How much of the volume may be covered twice, or left uncovered, by Boolean operations."""

SMALLEST_SINE = 1e-9
WAVES = 4
"""Invariant functions by which orbits of faces are told apart."""


@dataclass(frozen=True)
class SolidCertificate:
    """Whether the copies of a solid fill space, and by how much it misses what it must be.

    - `valid`: Whether all that is asked holds.
    - `reasons`: What does not, in words.
    - `faces`: The number of triangles.
    - `euler_number`: 2 for a solid without handles.
    - `crossings`: How many pairs of triangles meet where they should not; None if not computed.
    - `volume_error`: By how much the volume differs from det B / |G|, relative to it.
    - `unpaired_faces`: How many triangles have no partner.
    - `pair_error`: The farthest that a corner is from its partner's copy, in edges of a cube as large
      as the solid.
    - `overlap`, `gap`: The largest volume shared with a copy, and what copies leave uncovered of a box
      around it, less what they cover twice, relative to the volume; None if not computed.
    - `neighbors`: How many copies come near it.
    """

    valid: bool
    reasons: tuple[str, ...]
    faces: int
    euler_number: int
    crossings: int | None
    volume_error: float
    unpaired_faces: int
    pair_error: float
    overlap: float | None
    gap: float | None
    neighbors: int

    @property
    def is_ball(self) -> bool:
        """Whether it is valid and has no handles."""
        return self.valid and self.euler_number == 2


def certify_solid(
    group: CrystallographicGroup, mesh: Mesh, *, boolean: bool = True
) -> SolidCertificate:
    """Return the proof that a solid's copies under a group fill space, or the reasons why they do not.

    1. The surface is closed and one piece; all its faces are counter-clockwise from outside.
    2. No two triangles cross or touch but in the edges and corners that they share, by exact
       arithmetic. So its winding number is 1 inside and 0 outside.
    3. Its volume is det B / |G|.
    4. Its faces are in pairs: an element g of the group takes the one onto the other, turned over.

    These suffice. Let W(x) be the sum of the winding numbers of all copies at x, which is the number of
    copies that hold x. Across a face of one copy, the face's partner belongs to another copy and is
    crossed from the other side. So W does not change, and is the same everywhere. Its mean over a
    cell is |G| vol(T) / det B = 1. So each point, off the faces, is in exactly one copy.

    Boolean operations check the same, independently: what is shared with each copy that comes near, and
    whether the copies' parts of a box around it have the box's volume.

    Args:
        group: A space group.
        mesh: The surface of the solid.
        boolean: Whether to do the Boolean operations; they are left out where the rest fails.
    """
    share = group.cell_volume / group.order
    size = share ** (1 / 3)
    reasons = _shape_reasons(mesh)
    closed = not reasons
    crossings = len(crossing_pairs(mesh.points, mesh.faces)) if closed else None
    if crossings:
        reasons.append(f"{crossings} pairs of triangles cross or touch")
    volume_error = abs(mesh.volume / share - 1)
    if not volume_error <= VOLUME_TOLERANCE:
        reasons.append(
            f"its volume is {mesh.volume:.9g}, not the cell's share {share:.9g} for each copy"
        )
    paired, pair_error = face_partners(group, mesh)
    unpaired = int(np.sum(paired < 0))
    if unpaired:
        reasons.append(f"{unpaired} of {len(paired)} faces match no other under the group")
    overlap, gap, neighbors = None, None, 0
    if boolean and not reasons:
        overlap, gap, neighbors = boolean_errors(group, mesh)
        if not overlap <= BOOLEAN_TOLERANCE:
            reasons.append(f"a copy shares {overlap:.2g} of its volume")
        if not abs(gap) <= BOOLEAN_TOLERANCE:
            reasons.append(f"the copies leave {gap:.2g} of its volume uncovered around it")
    return SolidCertificate(
        valid=not reasons,
        reasons=tuple(reasons),
        faces=len(mesh.faces),
        euler_number=mesh.euler_number,
        crossings=crossings,
        volume_error=volume_error,
        unpaired_faces=unpaired,
        pair_error=pair_error / size,
        overlap=overlap,
        gap=gap,
        neighbors=neighbors,
    )


def _shape_reasons(mesh: Mesh) -> list[str]:
    """Return why a mesh is not the surface of one solid, apart from crossings."""
    if not len(mesh.faces):
        return ["it has no faces"]
    reasons: list[str] = []
    if not mesh.is_closed:
        reasons.append("it is not closed: an edge is not of two faces that run along it oppositely")
    if flat := len(mesh.thin_faces(SMALLEST_SINE)):
        reasons.append(f"{flat} triangles have no area")
    pieces = int(mesh.piece_of_faces.max()) + 1
    if pieces > 1:
        reasons.append(f"it is in {pieces} pieces")
    if mesh.volume <= 0:
        reasons.append("its faces are seen clockwise from outside")
    return reasons


def face_partners(group: CrystallographicGroup, mesh: Mesh) -> tuple[Integers, float]:
    """Return for each face the one that an element of the group takes to it, turned over.

    Returns the partners (M,), -1 where there is none, or several, and how far corners are from their
    partners' copies at most. A face is its own partner where an element turns it over.
    """
    corners, number = mesh.corners, len(mesh.faces)
    size = (group.cell_volume / group.order) ** (1 / 3)
    tolerance = PAIR_TOLERANCE * size
    centers = corners.mean(axis=1)
    first, second = _equivalent(group, centers)
    every = np.arange(number)
    first, second = (
        np.concatenate(rows) for rows in ((first, second, every), (second, first, every))
    )
    partners, matches = np.full(number, -1), np.zeros(number, np.int64)
    error = 0.0
    for coset, (linear, shift) in enumerate(
        zip(group.linear_parts, group.translations, strict=True)
    ):
        offset = centers[first] - centers[second] @ linear.T - shift
        steps = np.round(offset @ group.inverse_lattice.T)
        rest = offset - steps @ group.lattice.T
        near = np.abs(rest).max(axis=1) <= 4 * tolerance
        if coset == 0:
            near &= (first != second) | steps.any(axis=1)
        face, other, move = first[near], second[near], steps[near] @ group.lattice.T + shift
        images = corners[other] @ linear.T + move[:, None]
        if np.linalg.det(linear) > 0:  # turned over, the corners run the other way
            images = images[:, ::-1]
        misses = [
            np.linalg.norm(np.roll(images, k, axis=1) - corners[face], axis=2).max(axis=1)
            for k in range(3)
        ]
        miss = np.min(misses, axis=0)
        fits = miss <= tolerance
        partners[face[fits]] = other[fits]
        np.add.at(matches, face[fits], 1)
        error = max(error, float(miss[fits].max(initial=0.0)))
    mutual = (partners >= 0) & (matches == 1)
    mutual &= partners[np.where(partners >= 0, partners, 0)] == every
    return np.where(mutual, partners, -1), error


def _equivalent(group: CrystallographicGroup, points: Array) -> tuple[Integers, Integers]:
    """Return pairs of points that may be of one orbit, by the values of invariant functions."""
    rng = np.random.default_rng(0)
    # low frequencies: no steeper than the tolerance allows for
    every = itertools.product((-2, -1, 0, 1, 2), repeat=3)
    waves = rng.permutation(np.array([wave for wave in every if any(wave)]))
    fractional = points @ group.inverse_lattice.T
    values = np.zeros((len(points), WAVES))
    parts, shifts = group.integral_parts, group.translations @ group.inverse_lattice.T
    weights = rng.normal(size=(WAVES, 3))
    for part, shift in zip(parts, shifts, strict=True):
        image = fractional @ part.T + shift
        for k in range(WAVES):
            for weight, wave in zip(weights[k], waves[3 * k : 3 * k + 3], strict=True):
                values[:, k] += weight * np.cos(2 * np.pi * (image @ wave) + 1.3 * k + weight)
    pairs = cKDTree(values).query_pairs(200 * PAIR_TOLERANCE * group.order, output_type="ndarray")
    return pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64)


def boolean_errors(group: CrystallographicGroup, mesh: Mesh) -> tuple[float, float, int]:
    """Return the largest overlap with a copy, what copies leave uncovered, and how many are near.

    Both are relative to the solid's volume. Of two copies that are each other's inverses only one is
    asked, as both share as much. What is uncovered is a box's volume less that of the copies' parts in
    it. The box is a little larger than the solid's, so that it shows gaps behind all faces.
    """
    volume = mesh.volume
    center = (mesh.points.min(axis=0) + mesh.points.max(axis=0)) / 2
    half = np.ptp(mesh.points, axis=0) / 2 * (1 + 1e-3 * np.sqrt([2, 3, 5]))
    try:
        solid = as_body(Mesh(mesh.points - center, mesh.faces))
    except OrbiflowError:
        return 1.0, 1.0, 0
    box = Manifold.cube((2 * half).tolist(), True)
    radius = float(np.linalg.norm(mesh.points - center, axis=1).max())
    reach = radius + float(np.linalg.norm(half))
    rest, overlap, near = 8 * float(np.prod(half)), 0.0, 0
    compared: list[Isometry] = []
    for element in group.elements_near(center, reach):
        shift = element(center) - center
        middle = mesh.points @ element.linear.T + (element.translation - center)
        if np.any(middle.min(axis=0) > half) or np.any(middle.max(axis=0) < -half):
            continue
        copy = moved_body(solid, element.linear, shift)
        rest -= (copy ^ box).volume()
        if np.allclose(element.linear, np.eye(3)) and np.allclose(element.translation, 0):
            continue
        near += 1
        if not any(_are_inverse(element, other, radius) for other in compared):
            compared.append(element)
            overlap = max(overlap, _shared_volume(solid, copy, volume))
    return overlap / volume, rest / volume, near


def _shared_volume(first: Manifold, second: Manifold, volume: float) -> float:
    """Return the volume that two of manifold3d's solids share.

    Where faces coincide, rounding can spoil it by a triangle's thickness; in another frame it is
    rounded otherwise, so the least of three counts.
    """
    least = common_volume(first, second)
    for angle in (1.0, 2.0):
        if least <= BOOLEAN_TOLERANCE / 4 * volume:
            break
        turn = Rotation.from_rotvec(np.array([0.3, 0.5, 0.8]) * angle).as_matrix()
        least = min(least, common_volume(moved_body(first, turn), moved_body(second, turn)))
    return least


def _are_inverse(first: Isometry, second: Isometry, size: float) -> bool:
    if not np.allclose(first.linear @ second.linear, np.eye(3), atol=1e-6):
        return False
    shift = first.linear @ second.translation + first.translation
    return bool(np.abs(shift).max() < 1e-6 * size)
