"""Isometries, crystallographic groups and their catalogue."""

from orbiflow.symmetry.catalogue import (
    IDENTIFICATION_SPACES,
    LATTICES,
    WALLPAPER_GROUPS,
    identification_group,
    wallpaper_group,
)
from orbiflow.symmetry.dirichlet import DirichletDomain
from orbiflow.symmetry.equivariance import EquivarianceError, assert_equivariant
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.isometry import Isometry, identity, translation
from orbiflow.symmetry.plane import Line, reflection, rotation, rotation_matrix, transflection

__all__ = [
    "IDENTIFICATION_SPACES",
    "LATTICES",
    "WALLPAPER_GROUPS",
    "CrystallographicGroup",
    "DirichletDomain",
    "EquivarianceError",
    "Isometry",
    "Line",
    "assert_equivariant",
    "identification_group",
    "identity",
    "reflection",
    "rotation",
    "rotation_matrix",
    "transflection",
    "translation",
    "wallpaper_group",
]
