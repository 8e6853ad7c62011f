"""Initial poses: turns of the template that are really different."""

from __future__ import annotations

import itertools
import math

import torch
from torch import Tensor

from orbiflow.symmetry import CrystallographicGroup, Line, reflection, rotation
from orbiflow.symmetry.isometry import Array, Isometry
from orbiflow.tilings import IsohedralClass


def template_symmetries(isohedral_class: IsohedralClass) -> tuple[int, bool]:
    """Rotations and reflections of the template that also leave its group alone.

    Two starts that differ by such a map give the same tiles.

    Returns:
        The order of the rotations, and whether there is a reflection (then mirrored targets need
        no starts of their own).
    """
    vertices = isohedral_class.template()
    group = isohedral_class.group()
    center = vertices.mean(axis=0)
    order = max(n for n in (1, 2, 3, 6) if _keeps(rotation(center, n), vertices, group))
    spokes = [*vertices, *((a + b) / 2 for a, b in itertools.pairwise(vertices))]
    mirrored = any(
        _keeps(reflection(Line(center, spoke - center)), vertices, group) for spoke in spokes
    )
    return order, mirrored


def initial_poses(isohedral_class: IsohedralClass, turns: int) -> tuple[Tensor, Tensor]:
    """Angles (S,) in radians and mirror flags (S,): `turns` angles, twice if mirroring matters.

    The angles divide the range in which the template does not look the same.
    """
    order, mirror_closed = template_symmetries(isohedral_class)
    angles = torch.arange(turns, dtype=torch.float64) * (2 * math.pi / order / turns)
    if mirror_closed:
        return angles, torch.zeros(turns, dtype=torch.bool)
    return angles.repeat(2), torch.arange(2 * turns) >= turns


def _keeps(isometry: Isometry, vertices: Array, group: CrystallographicGroup) -> bool:
    distance = abs(isometry(vertices)[:, None] - vertices[None]).max(axis=-1)
    if distance.min(axis=1).max() > 1e-9:
        return False
    integral = group.inverse_lattice @ isometry.linear @ group.lattice
    undo = isometry.inverse()
    return bool(abs(integral - integral.round()).max() < 1e-9) and all(
        group.contains(isometry @ g @ undo) for g in group.cosets
    )
