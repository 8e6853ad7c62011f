"""Rotations SO(3) and orientations: SO(3) modulo the symmetry of a crystal and that of a specimen."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any, Self, cast

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import check_form, is_angular
from orbiflow.density.spaces.axes import whole_turn
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.point_groups import rotation_group_name, rotations_of
from orbiflow.density.spaces.round import UNIT_TOLERANCE, refuse_rows, to_unit
from orbiflow.density.spaces.unit_vectors import UnitVectorSpace
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import as_choice
from orbiflow.typed_torch import linalg

FORMS: dict[str, tuple[str, ...]] = {
    "quaternion": ("x", "y", "z", "w"),
    "scalar-first": ("w", "x", "y", "z"),
    "vector": ("rx", "ry", "rz"),
    "rodrigues": ("rodrigues1", "rodrigues2", "rodrigues3"),
    "matrix": tuple(f"r{i}{j}" for i in "123" for j in "123"),
    "ZXZ": ("phi1", "Phi", "phi2"),
}
"""Columns of rotations in each form. A quaternion's scalar is last but in "scalar-first", a vector is
axis times angle, Rodrigues' vector axis times the tangent of half the angle."""

EULER = ("ZXZ", "ZYZ", "XYZ", "ZYX", "xyz", "zyx")
"""Axes of Euler angles: fixed ones or, in capitals, those that turn along."""

LEAST_SCALAR = 1e-15
"""The least scalar part of a quaternion by which Rodrigues' vector is divided: half a turn has none."""


class RotationSpace(UnitVectorSpace):
    """The rotations SO(3), as unit quaternions up to sign, or orientations of crystals in a specimen.

    A rotation g takes the crystal's coordinates of a vector to the specimen's, so Bunge's Euler angles
    phi1, Phi, phi2 are turns about z, x and z that turn along ("ZXZ"). The rotation g is the same
    orientation as l g s for each rotation l of the specimen's symmetry and s of the crystal's.

    The natural measure is the area of the sphere of quaternions: pi^2 in all, divided by the orders of
    both groups. (In radians of rotation it would be eight times as much, 8 pi^2 in all.) Of a
    rotation's images, the canonical one has the smallest angle.

    Args:
        form: How `from_chart` writes rotations: "quaternion" (x, y, z, w), "scalar-first" (w, x, y, z),
            "vector" (axis times angle), "rodrigues" (axis times the tangent of half the angle),
            "matrix" (nine numbers, row by row), or Euler angles by their axes, such as "ZXZ" or "bunge"
            for Bunge's. `to_chart` knows quaternions and matrices by their width.
        unit: Unit of vectors and Euler angles: "radians", "degrees" or "turns".
        symmetry: Symmetry of the crystal, such as "432", "m-3m", "O" or "cubic" (see
            `rotation_group_name`). Default: none.
        specimen: Symmetry of the specimen, such as "222" or "orthotropic". Default: none.
        passive: Whether data are the inverse rotations, which take the specimen's coordinates to the
            crystal's. Bunge's angles name an orientation either way, so they cannot be passive.

    Raises:
        OrbiflowError: If a form, a unit or a symmetry is unknown.

    >>> space = RotationSpace(form="bunge", unit="degrees", symmetry="cubic")
    >>> space.from_chart(space.to_chart([[100.0, 0.0, 0.0]])).round(9).tolist()
    [[10.0, 0.0, 0.0]]
    """

    name = "rotation-space"

    def __init__(
        self,
        *,
        form: str = "quaternion",
        unit: str = "radians",
        symmetry: str | None = None,
        specimen: str | None = None,
        passive: bool = False,
    ) -> None:
        form = "ZXZ" if form == "bunge" else form
        self.form = as_choice(form, tuple(dict.fromkeys((*FORMS, *EULER))), "form")
        self.period, self.angle_unit, self.passive = whole_turn(unit), unit, passive
        self.symmetry = rotation_group_name(symmetry or "C1")
        self.specimen = rotation_group_name(specimen or "C1", "specimen")
        if passive and form == "ZXZ":
            raise SettingError(
                "{passive} does not apply to Bunge's angles, which name the same orientation whether "
                "one thinks of the rotation or of its inverse: leave it out"
            )
        self.columns = FORMS.get(form, ("angle1", "angle2", "angle3"))
        super().__init__(_products(self.crystal_rotations, self.specimen_rotations))

    @property
    def periods(self) -> tuple[float, ...]:
        return tuple(self.period * (self.form in EULER) for _ in self.columns)

    def data_unit(self, width: int) -> str | None:
        return self.angle_unit if is_angular(self.name, width, self.form_of(width)) else None

    @property
    def crystal_rotations(self) -> Rotation:
        """The rotations s of the crystal's symmetry: g s is the orientation g."""
        return rotations_of(self.symmetry)

    @property
    def specimen_rotations(self) -> Rotation:
        """The rotations l of the specimen's symmetry: l g is the orientation g."""
        return rotations_of(self.specimen)

    @property
    def kernel_images(self) -> int:
        # images by the specimen's symmetry are those of points
        return len(self.elements) // len(self.specimen_rotations)

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del seed
        return cls(form={3: "vector", 9: "matrix"}.get(data.shape[1], "quaternion"), unit=unit)

    def form_of(self, width: int) -> str:
        """Return the form of data of so many columns."""
        three = self.form if self.form in (*EULER, "rodrigues") else "vector"
        four = "scalar-first" if self.form == "scalar-first" else "quaternion"
        return {3: three, 9: "matrix"}.get(width, four)

    def form_in(self, names: Sequence[str]) -> str | None:
        form = self.form_of(len(names))
        check_form(self.data_name, names, form)
        return form

    @property
    def widths(self) -> tuple[int, ...]:
        return (3, 4, 9)

    def cover(self, data: ArrayLike) -> Tensor:
        what = "rotations (three angles or a vector, a quaternion or a matrix in each row)"
        table = checked_table(data, self.widths, what)
        if table.shape[1] == 4:
            return torch.tensor(self._signed(np.roll(to_unit(table), -self._first, axis=1)))
        rotations = _from_matrices(table) if table.shape[1] == 9 else self._from_three(table)
        return torch.tensor(self._signed(rotations.as_quat()))

    @property
    def _first(self) -> int:
        """The places by which a row's quaternion is turned, whose scalar may be first."""
        return int(self.form == "scalar-first")

    def _signed(self, quaternions: Array) -> Array:
        """Return quaternions (N, 4) of the rotations themselves from those of the data, or back."""
        return quaternions * (-1.0, -1.0, -1.0, 1.0) if self.passive else quaternions

    def _from_three(self, table: Array) -> Rotation:
        if self.form_of(3) == "rodrigues":
            return Rotation.from_quat(np.column_stack([table, np.ones(len(table))]))
        angles, euler = table * (2 * math.pi / self.period), self.form in EULER
        refuse_rows(
            (abs(angles).max(axis=1) if euler else np.linalg.norm(angles, axis=1)) > 6.2832,
            lambda row: (
                f"{table[row].tolist()} is more than a turn in {self.angle_unit}: change the unit"
            ),
        )
        return Rotation.from_euler(self.form, angles) if euler else Rotation.from_rotvec(angles)

    def from_chart(self, points: Tensor) -> Array:
        quaternions = self._signed(super().from_chart(points).reshape(-1, 4))
        rotations = Rotation.from_quat(quaternions)
        if self.form in ("quaternion", "scalar-first"):
            return np.roll(rotations.as_quat(), self._first, axis=1)
        if self.form == "matrix":
            return rotations.as_matrix().reshape(-1, 9)
        if self.form == "rodrigues":
            upper = rotations.as_quat(canonical=True)
            return upper[:, :3] / np.maximum(upper[:, 3:], LEAST_SCALAR)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of gimbal lock, where one angle is free
            euler = self.form in EULER
            angles: Array = (
                rotations.as_euler(cast(Any, self.form)) if euler else rotations.as_rotvec()
            )
        angles = angles * (self.period / (2 * math.pi))
        # Bunge's angles are from 0 on
        return np.where(angles < 0, angles + self.period, angles) if self.form == "ZXZ" else angles

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        """Return gradients (N, 4) at unit quaternions, tangent to their sphere."""
        if np.shape(data)[1] != 4:
            raise OrbiflowError("gradients of rotations need unit quaternions: convert the rows")
        slopes = super().data_gradient(data, points, gradient)
        return np.roll(self._signed(slopes), self._first, axis=1)

    def misorientations(self, points: Tensor, reference: Tensor) -> Tensor:
        """Return the angles (N,) in radians between orientations (N, 4) and one (4,).

        Of all rotations that take one of the images to the other, they are the smallest.
        """
        images, points = self.features(reference[None].double())[:, 0], points.double()
        near = images[(images @ points.mT).argmax(dim=0)]
        # half the chord is the sine of a quarter of the angle: an arc cosine would lose small ones
        chord = linalg.vector_norm(points - near, dim=1)
        return 4 * torch.asin((chord / 2).clamp_max(1))

    def step_angle(self, step: float) -> float:
        return 2 * math.pi * step / self.period

    def settings(self) -> dict[str, Any]:
        options = {"form": self.form, "unit": self.angle_unit, "symmetry": self.symmetry}
        return {**options, "specimen": self.specimen, "passive": self.passive}


def _products(crystal: Rotation, specimen: Rotation) -> Array:
    """Return the matrices (E, 4, 4) that take quaternions q to both signs of l q s.

    Those of the first l, the identity, come first, and the identity is the first of all.
    """
    # products are linear: their columns are those with the four units
    units = Rotation.from_quat(np.eye(4))
    right = np.stack([(units * turn).as_quat().T for turn in crystal])
    left = np.stack([(turn * units).as_quat().T for turn in specimen])
    both = np.concatenate([right, -right])
    both = both[np.argsort(-np.trace(both, axis1=1, axis2=2), kind="stable")]
    left = left[np.argsort(-np.trace(left, axis1=1, axis2=2), kind="stable")]
    return np.einsum("aij,bjk->abik", left, both).reshape(-1, 4, 4)


def _from_matrices(table: Array) -> Rotation:
    matrices = table.reshape(-1, 3, 3)
    off = abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    refuse_rows(
        (off > 2 * UNIT_TOLERANCE) | (np.linalg.det(matrices) < 0),
        lambda row: f"{table[row].round(4).tolist()} is no rotation matrix, row by row",
    )
    return Rotation.from_matrix(matrices)
